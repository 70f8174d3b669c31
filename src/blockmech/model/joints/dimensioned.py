"""The drawing that fulfils its dimensions: points move as little as they must.

Unknowns are the positions of joints and markers in the drawing, whose joints are closed first.
Gauss-Newton steps of least length go from the positions as they are drawn to the nearest that
fulfil the dimensions; then places on the links follow. Points of the frame follow the dimensions
that name only such points, and all others move against them, those of a link that slides on the
frame along its guide; where these cannot fulfil the rest, they leave it, and then all points move
alike. Singular values of the Jacobian tell what remains: combinations of residuals
that no motion changes are dimensions too many, motions that change no residual are points that
remain free. One more step with numbers that carry derivatives hands these on, for the residuals
are zero and the Jacobian is known (implicit function theorem).

Source: Nocedal & Wright, Numerical Optimization, 2nd ed., ch. 10 (Gauss-Newton method).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np

from blockmech.functions.roots import LONGEST_STEP, NEWTON_STEPS
from blockmech.ground.errors import GraphError, Problem, listed, path_text
from blockmech.ground.report import Facts, Report
from blockmech.ground.tolerances import DOUBLE_ROOT, EQUAL
from blockmech.ground.values import Pair
from blockmech.model.joints.closing import Closing, tolerance
from blockmech.model.joints.contents import FRAME, reference_problems
from blockmech.model.joints.dimensions import Dimension
from blockmech.model.joints.layout import Layout, LinkPlacement
from blockmech.model.joints.linkage import Linkage
from blockmech.model.joints.varied import Varied, settled, tangents
from blockmech.model.parameters import Path, value_at
from blockmech.typing import Complex, Floats, Real

L = TypeVar("L", bound=Linkage)


class Side(NamedTuple):
    """A point on a link: path of its place in the document, and the link's x axis."""

    path: Path
    e: complex


@dataclass(frozen=True, repr=False)
class Dimensions(Facts, Report):
    """Result of fitting a drawing to its dimensions.

    Attributes
    ----------
    linkage : the drawing that satisfies them
    moved : point -> distance [m] by which it was moved
    redundant : dimensions that follow from the rest
    free : points that can still move against those of the frame, with all dimensions
    freedoms : number of their degrees of freedom
    frame : points of the frame that moved because the others cannot fulfil the dimensions alone
    """

    linkage: Linkage
    moved: Mapping[str, float]
    redundant: tuple[str, ...]
    free: tuple[str, ...]
    freedoms: int
    frame: tuple[str, ...] = ()

    def lines(self) -> Iterator[str]:
        """Satisfied dimensions, then the remaining degrees of freedom."""
        farthest = max(self.moved, key=lambda name: self.moved[name], default="")
        moved = f"; {farthest} moved most, by {self.moved[farthest]:.3g} m" if farthest else ""
        yield f"dimensions satisfied: {len(self.linkage.dimensions)}{moved}"
        if self.frame:
            yield f"{listed(self.frame)} of the frame moved: other points alone cannot satisfy them"
        if self.redundant:
            yield f"{listed(self.redundant)} follow from the rest"
        freedoms = f"degrees of freedom left: {self.freedoms}, of {listed(self.free)}"
        yield freedoms if self.free else "no point remains free"


def fit_dimensions(linkage: Linkage) -> Dimensions:
    """The drawing that fulfils its dimensions, and what they leave open.

    Raises `GraphError` for dimensions that contradict each other, and for unknown names.
    """
    GraphError.raise_for(reference_problems(linkage, vars(linkage)))
    drawing = _Drawing(linkage)
    fit = drawing.fit()
    left, s, _ = np.linalg.svd(fit.jacobian)
    rank = int((s > EQUAL * s.max(initial=0.0)).sum())
    owners = [name for name, _ in drawing.rows(drawing.start)]
    if fit.misfit > drawing.tolerance:
        wrong = {
            n for n, r in zip(owners, fit.residuals, strict=True) if abs(r) > drawing.tolerance
        }
        raise GraphError(_contradiction(linkage, wrong, fit.misfit, drawing.size))
    tied = np.abs(left[:, rank:]).max(axis=1, initial=0.0) > math.sqrt(EQUAL)
    redundant = dict.fromkeys(n for n, part in zip(owners, tied, strict=True) if part)
    positions = drawing.positions(fit.x)
    away = {n: float(abs(z - drawing.start[n])) for n, z in positions.items()}
    moved = {name: d for name, d in away.items() if d > drawing.tolerance * drawing.size}
    _, s, right = np.linalg.svd(fit.jacobian[:, ~drawing.on_frame])
    motions = right[int((s > EQUAL * s.max(initial=0.0)).sum()) :]
    loose = np.abs(motions).max(axis=0, initial=0.0).reshape(-1, 2).max(axis=1, initial=0.0)
    others = [name for name in drawing.points if name not in drawing.frame]
    return Dimensions(
        linkage.with_checked(settled(drawing.numbers(positions))),
        moved,
        tuple(redundant),
        tuple(n for n, share in zip(others, loose, strict=True) if share > math.sqrt(EQUAL)),
        len(motions),
        () if fit.frame_first else tuple(name for name in moved if name in drawing.frame),
    )


def dimensioned(linkage: L) -> L:
    """The drawing that fulfils its dimensions, with derivatives where its numbers carry some.

    Raises `GraphError` for dimensions that contradict each other, and for unknown names.
    """
    if not linkage.dimensions:
        return linkage
    GraphError.raise_for(reference_problems(linkage, vars(linkage)))
    drawing = _Drawing(linkage)
    fit = drawing.fit()
    if fit.misfit > drawing.tolerance:
        fit_dimensions(linkage)  # which says why
    positions = drawing.positions(fit.x)
    varied = _Drawing(linkage, plain=False)
    moved = {n: z + (varied.start[n] - drawing.start[n]) for n, z in positions.items()}
    residuals = [r for _, r in varied.rows(moved)]
    if any(isinstance(r, Varied) for r in residuals):
        for i, name in enumerate(drawing.points):
            dx, dy = (
                sum(-a * r for a, r in zip(row.tolist(), residuals, strict=True))
                for row in fit.inverse[2 * i : 2 * i + 2]
            )
            moved[name] = moved[name] + (dx + dy * 1j) * drawing.size
    return linkage.with_numbers(varied.numbers(moved))


class _Fit(NamedTuple):
    """Positions at which the dimensions hold best.

    x : (2n,) positions over the size of the drawing
    residuals, jacobian : (m,), (m, 2n), of the dimensions
    inverse : (2n, m) residuals -> the step that takes them away
    frame_first : points of the frame follow the dimensions of the frame alone
    """

    x: Floats
    residuals: Floats
    jacobian: Floats
    inverse: Floats
    frame_first: bool

    @property
    def misfit(self) -> float:
        """Largest residual."""
        return float(np.abs(self.residuals).max(initial=0.0))


class _Drawing:
    """Points of a document where they are drawn, its joints closed.

    points : names of joints and markers
    start : point -> position [m]
    tolerance : what is left, over the size of the drawing, of what is fulfilled
    frame : those of the points that are on the frame
    on_frame : (2n,) whether a coordinate is that of such a point
    normals : point of a link that slides on the frame -> directions across its guides
    """

    def __init__(self, linkage: Linkage, plain: bool = True) -> None:
        varied = Layout.of(linkage)
        layout = settled(varied)
        closing = Closing.of(layout)
        self.linkage, self.size = linkage, layout.size
        poses = closing.refine(layout.given)
        self.tolerance = tolerance(poses, self.size)
        self.frames: dict[str, tuple[Complex, Complex]] = {
            link: (pose.o, pose.direction(1 + 0j)) for link, pose in poses.items()
        }
        gaps = [x for _, (x, *_) in Closing.of(varied)._rows(poses)]
        if not plain and any(isinstance(gap, Varied) for gap in gaps):  # joints stay closed
            inverse = np.linalg.pinv(closing.conditions(poses)[1], rcond=DOUBLE_ROOT)
            for link, rows in zip(closing.links, -inverse.reshape(-1, 3, len(gaps)), strict=True):
                x, y, turn = (
                    sum(float(a) * tangents(gap) for a, gap in zip(row, gaps, strict=True))
                    for row in rows
                )
                o, e = self.frames[link]
                self.frames[link] = Varied(o, (x + 1j * y) * self.size), Varied(e, 1j * e * turn)
        self.dimensions = linkage.dimensions
        if plain:
            self.dimensions = {name: _settled(x) for name, x in linkage.dimensions.items()}
        self.guides = {
            c.second if c.first == FRAME else c.first: 1j * c.along[c.first != FRAME]
            for c in layout.pairs.values()
            if c.kind == "P" and FRAME in (c.first, c.second)
        }
        self.normals: dict[str, list[complex]] = {}
        self.sides: dict[str, list[Side]] = {}
        self.start: Complex = {}
        self.frame: set[str] = set()
        welds = layout.welds if plain else varied.welds
        for name, joint in linkage.joints.items():
            for k, (link, at) in enumerate(zip(joint.links, joint.at, strict=True)):
                self._side(name, ("joints", name, "at", k), at.z, link, welds, plain)
        for link, given in linkage.links.items():
            for name, marker in given.markers.items():
                path = ("links", link, "markers", name, "at")
                self._side(f"{link}.{name}", path, marker.at.z, link, welds, plain)
        self.points = list(self.start)
        self.on_frame = np.repeat([name in self.frame for name in self.points], 2)

    def _side(
        self,
        name: str,
        path: Path,
        z: Complex,
        link: str,
        welds: Mapping[str, LinkPlacement],
        plain: bool,
    ) -> None:
        """Note a point on one of its links; its position is that on the first."""
        weld = welds[link]
        o, e = self.frames[weld.link]
        if weld.link == FRAME:
            self.frame.add(name)
        if weld.link in self.guides:
            self.normals.setdefault(name, []).append(self.guides[weld.link])
        z = settled(z) if plain else z
        self.start.setdefault(name, o + weld.place(z) * e)
        self.sides.setdefault(name, []).append(Side(path, weld.direction(1 + 0j) * e))

    def rows(self, positions: Complex) -> Iterator[tuple[str, Real]]:
        """Dimension and residual. Raises `GraphError` for a line whose ends coincide."""
        for name, dimension in self.dimensions.items():
            z = [positions[point] for point in dimension.points]
            try:
                with np.errstate(divide="raise", invalid="raise"):
                    residuals = list(dimension.residuals(z, self.size))
            except ArithmeticError:
                raise GraphError(_coincidence(name, dimension)) from None
            yield from ((name, residual) for residual in residuals)

    def positions(self, x: Floats) -> dict[str, complex]:
        """Positions [m] of the points, of unknowns (2n,) over the size."""
        z = self.size * (x[0::2] + 1j * x[1::2])
        return dict(zip(self.points, z.tolist(), strict=True))

    def _residuals(self, x: Floats) -> tuple[Floats, Floats]:
        """Residuals (m,) and their derivatives (m, 2n)."""
        units = self.size * np.eye(len(x))
        z = {
            name: Varied(at, units[2 * i] + 1j * units[2 * i + 1])
            for i, (name, at) in enumerate(self.positions(x).items())
        }
        rows = [r for _, r in self.rows(z)]
        matrix = np.reshape([np.real(r.d) for r in rows], (len(rows), len(x)))
        return np.array([complex(r).real for r in rows]), matrix

    def fit(self) -> _Fit:
        """The frame by its own dimensions, then the rest; all points where that leaves a misfit."""
        for frame_first, guided in ((True, True), (True, False), (False, False)):
            fit = self._fit(frame_first, guided)
            if fit.misfit <= self.tolerance:
                break
        return fit

    def _fit(self, frame_first: bool, guided: bool) -> _Fit:
        z = np.array([self.start[name] for name in self.points]) / self.size
        x: Floats = np.stack([z.real, z.imag], 1).ravel()
        values, matrix = self._residuals(x)
        for _ in range(NEWTON_STEPS):
            step = -self._inverse(matrix, frame_first, guided) @ values
            step *= LONGEST_STEP / np.abs(step).max(initial=LONGEST_STEP)
            x = x + step
            before, (values, matrix) = np.abs(values).max(initial=0.0), self._residuals(x)
            now = np.abs(values).max(initial=0.0)
            if now == 0 or (np.abs(step).max(initial=0.0) < self.tolerance and now >= before / 2):
                break
        return _Fit(x, values, matrix, self._inverse(matrix, frame_first, guided), frame_first)

    def _inverse(self, jacobian: Floats, frame_first: bool, guided: bool) -> Floats:
        """Least steps (2n, m); those of the frame may come first, and the rest after them."""
        named = [self.frame.issuperset(self.dimensions[n].points) for n, _ in self.rows(self.start)]
        rows, columns = frame_first & np.array([named], bool).T, frame_first & self.on_frame
        along = self._along_guides() if guided else np.eye(columns.size)
        frame = np.linalg.pinv(jacobian * rows * columns, rcond=EQUAL)
        rest = along @ np.linalg.pinv((jacobian * ~rows * ~columns) @ along, rcond=EQUAL)
        inverse: Floats = frame + rest @ (np.eye(len(jacobian)) - jacobian @ frame)
        return inverse

    def _along_guides(self) -> Floats:
        """What remains (2n, 2n) of steps without their parts across guides."""
        along: Floats = np.eye(2 * len(self.points))
        for name, normals in self.normals.items():
            i, n = 2 * self.points.index(name), np.array(normals)[:, None].view(float)
            along[i : i + 2, i : i + 2] -= np.linalg.pinv(n) @ n
        return along

    def numbers(self, positions: Complex) -> dict[Path, Complex]:
        """Path -> number of the document with points at other positions."""
        numbers: dict[Path, Complex] = {}
        sections = self.linkage.sections()
        for name, sides in self.sides.items():
            step = positions[name] - self.start[name]
            if not isinstance(step, Varied) and abs(step) <= self.tolerance * self.size:
                continue
            for path, e in sides:
                place = value_at(sections, path)
                z = place.z + step * e.conjugate()
                numbers |= {(*path, "x"): z.real, (*path, "y"): z.imag}
        return numbers


def _settled(dimension: Dimension) -> Dimension:
    """A dimension whose value has no derivatives."""
    value: Any = getattr(dimension, "value", None)
    value = type(value)(settled(value.z)) if isinstance(value, Pair) else settled(value)
    return dimension if value is None else dimension.model_copy(update={"value": value})


def _coincidence(name: str, dimension: Dimension) -> Problem:
    """The problem of a dimension of a line whose ends stand at one place."""
    where = path_text(("dimensions", name, "points"))
    fault = f"two of {listed(dimension.points)} stand at one place"
    return Problem("wrong-value", where, fault, "", f"draw them apart, or remove {name}")


def _contradiction(
    linkage: Linkage, wrong: set[str], misfit: float, size: float
) -> Iterator[Problem]:
    """The problem of dimensions that cannot hold together."""
    names = [name for name in linkage.dimensions if name in wrong]
    found = f"{listed(names)} cannot hold together: they miss by up to {misfit:.3g}"
    found += f" (lengths over {size:.3g} m, angles in rad)"
    where, remedy = path_text(("dimensions", names[-1])), f"change or remove one of {listed(names)}"
    yield Problem("conflicting-dimensions", where, found, "", remedy)
