"""The drawing that fulfils its dimensions: points move as little as they must.

Unknowns are the positions of joints and markers in the drawing, whose joints are closed first.
Gauss-Newton steps of least length go from the positions as they are drawn to the nearest that
fulfil the dimensions; then places on the links follow. The singular value decomposition of the
Jacobian tells the rest: combinations of residuals that no motion changes are dimensions too many,
motions that change no residual are points that remain free. One more step with numbers that carry
derivatives hands these on, for the residuals are zero and the Jacobian is known (implicit function
theorem).

Source: Nocedal & Wright, Numerical Optimization, 2nd ed., ch. 10 (Gauss-Newton method).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from blockmech.functions.roots import LONGEST_STEP, NEWTON_STEPS
from blockmech.ground.errors import GraphError, Problem, listed, path_text
from blockmech.ground.report import Facts, Report
from blockmech.ground.tolerances import EQUAL
from blockmech.ground.values import Pair
from blockmech.model.joints.closing import CLOSED, Closing
from blockmech.model.joints.contents import FRAME, reference_problems
from blockmech.model.joints.dimensions import Dimension
from blockmech.model.joints.layout import Layout, LinkPlacement, Pose
from blockmech.model.joints.linkage import Linkage
from blockmech.model.joints.varied import Varied, settled
from blockmech.model.parameters import Path, value_at
from blockmech.typing import Complex, Floats, Real


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
    free : points that can still move against the first points of the frame, with all dimensions
    freedoms : number of their degrees of freedom
    """

    linkage: Linkage
    moved: Mapping[str, float]
    redundant: tuple[str, ...]
    free: tuple[str, ...]
    freedoms: int

    def lines(self) -> Iterator[str]:
        """Satisfied dimensions, then the remaining degrees of freedom."""
        farthest = max(self.moved, key=lambda name: self.moved[name], default="")
        moved = f"; {farthest} moved most, by {self.moved[farthest]:.3g} m" if farthest else ""
        yield f"dimensions satisfied: {len(self.linkage.dimensions)}{moved}"
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
    if len(drawing.points) < 2:
        return Dimensions(linkage, {}, (), (), 0)
    x, values, jacobian = drawing.fit()
    left, s, right = np.linalg.svd(jacobian)
    rank = int((s > EQUAL * s.max(initial=0.0)).sum())
    owners = [name for name, _ in drawing.rows(drawing.start)]
    if np.abs(values).max(initial=0.0) > CLOSED:
        wrong = {name for name, value in zip(owners, values, strict=True) if abs(value) > CLOSED}
        raise GraphError(_contradiction(linkage, wrong, values, drawing.size))
    tied = np.abs(left[:, rank:]).max(axis=1, initial=0.0) > math.sqrt(EQUAL)
    motions = _beside_the_whole(right[rank:], x, drawing.anchors)
    loose = np.abs(motions).max(axis=0, initial=0.0).reshape(-1, 2).max(axis=1, initial=0.0)
    free = [n for n, share in zip(drawing.points, loose, strict=True) if share > math.sqrt(EQUAL)]
    redundant = dict.fromkeys(n for n, part in zip(owners, tied, strict=True) if part)
    away = {n: float(abs(z - drawing.start[n])) for n, z in drawing.positions(x).items()}
    return Dimensions(
        linkage.with_checked(settled(drawing.numbers(drawing.positions(x)))),
        {name: d for name, d in away.items() if d > CLOSED * drawing.size},
        tuple(redundant),
        tuple(free),
        len(motions),
    )


def dimensioned(linkage: Linkage) -> Linkage:
    """The drawing that fulfils its dimensions, with derivatives where its numbers carry some.

    Raises `GraphError` for dimensions that contradict each other.
    """
    if not linkage.dimensions:
        return linkage
    drawing = _Drawing(linkage)
    x, values, jacobian = drawing.fit()
    if np.abs(values).max(initial=0.0) > CLOSED:
        fit_dimensions(linkage)  # which says why
    positions = drawing.positions(x)
    varied = _Drawing(linkage, plain=False)
    moved = {n: z + (varied.start[n] - drawing.start[n]) for n, z in positions.items()}
    residuals = [r for _, r in varied.rows(moved)]
    if any(isinstance(r, Varied) for r in residuals):
        steps = np.linalg.pinv(jacobian, rcond=EQUAL)
        for i, name in enumerate(drawing.points):
            dx, dy = (
                sum(-a * r for a, r in zip(row.tolist(), residuals, strict=True))
                for row in steps[2 * i : 2 * i + 2]
            )
            moved[name] = moved[name] + (dx + dy * 1j) * drawing.size
    return linkage.with_numbers(varied.numbers(moved))


class _Drawing:
    """Points of a document where they are drawn, its joints closed.

    points : names of joints and markers
    start : point -> position [m]
    anchors : two of the points, of the frame if it has some
    """

    def __init__(self, linkage: Linkage, plain: bool = True) -> None:
        layout = settled(Layout.of(linkage))
        closing = Closing.of(layout)
        self.linkage, self.size = linkage, layout.size
        self.poses = closing.refine(layout.given)
        self.dimensions = linkage.dimensions
        if plain:
            self.dimensions = {name: _settled(x) for name, x in linkage.dimensions.items()}
        self.sides: dict[str, list[Side]] = {}
        self.start: Complex = {}
        for name, joint in linkage.joints.items():
            for k, (link, at) in enumerate(zip(joint.links, joint.at, strict=True)):
                self._side(name, ("joints", name, "at", k), at.z, link, layout.welds, plain)
        for link, given in linkage.links.items():
            for name, marker in given.markers.items():
                path = ("links", link, "markers", name, "at")
                self._side(f"{link}.{name}", path, marker.at.z, link, layout.welds, plain)
        self.points = list(self.start)
        fixed = [name for name, joint in linkage.joints.items() if FRAME in joint.links]
        first = [*fixed, *(name for name in self.points if name not in fixed)][:2]
        self.anchors = [self.points.index(name) for name in first]

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
        pose: Pose = self.poses[weld.link]
        z = settled(z) if plain else z
        self.start.setdefault(name, pose.point(weld.place(z)))
        self.sides.setdefault(name, []).append(Side(path, pose.direction(weld.direction(1 + 0j))))

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

    def fit(self) -> tuple[Floats, Floats, Floats]:
        """Unknowns (2n,) where the dimensions hold best, residuals (m,), derivatives (m, 2n)."""
        z = np.array([self.start[name] for name in self.points]) / self.size
        x: Floats = np.stack([z.real, z.imag], 1).ravel()
        values, matrix = self._residuals(x)
        for _ in range(NEWTON_STEPS):
            step = -np.linalg.lstsq(matrix, values, rcond=EQUAL)[0]
            step *= LONGEST_STEP / np.abs(step).max(initial=LONGEST_STEP)
            x = x + step
            before, (values, matrix) = np.abs(values).max(initial=0.0), self._residuals(x)
            now = np.abs(values).max(initial=0.0)
            if now == 0 or (np.abs(step).max(initial=0.0) < CLOSED and now >= before / 2):
                break
        return x, values, matrix

    def numbers(self, positions: Complex) -> dict[Path, Complex]:
        """Path -> number of the document with points at other positions."""
        numbers: dict[Path, Complex] = {}
        sections = self.linkage.sections()
        for name, sides in self.sides.items():
            step = positions[name] - self.start[name]
            if not isinstance(step, Varied) and abs(step) <= CLOSED * self.size:
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


def _beside_the_whole(motions: Floats, x: Floats, anchors: Sequence[int]) -> Floats:
    """Motions (j, 2n) that no dimension stops, of those (k, 2n) less the drawing as a whole.

    As far as it can move as a whole, the first anchor stays, and the second in line with it.
    """
    z = x[0::2] + 1j * x[1::2]
    shift = np.eye(2)[:, np.arange(len(x)) % 2]
    turn = np.stack([-z.imag, z.real], 1).reshape(1, -1)
    whole = np.linalg.qr(np.concatenate([shift, turn]).T)[0].T
    shares = np.linalg.svd(whole @ motions.T, compute_uv=False)
    rigid = int((shares > 1 - math.sqrt(EQUAL)).sum())
    held = np.zeros((3, len(x)))
    a, b = anchors
    held[:2, 2 * a : 2 * a + 2] = np.eye(2)
    held[2, 2 * b : 2 * b + 2] = (z[a] - z[b]).imag, (z[b] - z[a]).real
    gauge = held[[slice(0, 0), slice(2, 3), slice(0, 2), slice(0, 3)][rigid]]
    free: Floats = np.linalg.svd(gauge @ motions.T)[2][rigid:] @ motions
    return free


def _coincidence(name: str, dimension: Dimension) -> Problem:
    """The problem of a dimension of a line whose ends stand at one place."""
    where = path_text(("dimensions", name, "points"))
    fault = f"two of {listed(dimension.points)} stand at one place"
    return Problem("wrong-value", where, fault, "", f"draw them apart, or remove {name}")


def _contradiction(
    linkage: Linkage, wrong: set[str], values: Floats, size: float
) -> Iterator[Problem]:
    """The problem of dimensions that cannot hold together."""
    names = [name for name in linkage.dimensions if name in wrong]
    found = f"{listed(names)} cannot hold together: they miss by up to {np.abs(values).max():.3g}"
    found += f" (lengths over {size:.3g} m, angles in rad)"
    where, remedy = path_text(("dimensions", names[-1])), f"change or remove one of {listed(names)}"
    yield Problem("conflicting-dimensions", where, found, "", remedy)
