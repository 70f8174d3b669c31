r"""Synthesis: four-bars whose coupler point draws a path, or whose coupler passes positions.

**Path.** The shape of a four-bar with crank 1 (frame, coupler, rocker, coupler point) is sampled
by Sobol's points; to where the path is, how large and how turned, the best similarity

    P_j = A c(theta_j) + B,    A, B complex,

is a linear least-squares problem for each shape, so only the shape is searched. The best ones
are refined with all numbers free, the crank's angles too where no timing is asked for.

**Three positions.** Any point of the coupler lies on a circle through its three places: the
centre is its pivot on the frame. Two such points make a four-bar.

Every design is judged: on the way from the first position to the last the crank turns one way,
the linkage closes everywhere, and the dyad keeps its branch; others are left out.

Sources: Sandor & Erdman, Advanced Mechanism Design, vol. 2, ch. 2 and 3; Norton, Design of
Machinery, 6th ed., ch. 5 (circuit, branch and order defects).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.arguments import declared
from blockmech.assur.chains import chains, mechanisms
from blockmech.builders import Graph
from blockmech.errors import refused
from blockmech.export import aligned
from blockmech.series import Floats
from blockmech.told import DEGREES, TextReport, as_data
from blockmech.typing import Progress

__all__ = [
    "Design",
    "Synthesis",
    "chains",
    "coupler_point",
    "fourbar",
    "mechanisms",
    "path_generator",
    "saved",
    "three_positions",
]

Points = NDArray[np.complex128]
STARTS = 2**14  # shapes that are tried
REFINED = 24  # of them are refined
CHECKED = 361  # poses between the first position and the last
LOW, HIGH = math.log(0.15), math.log(6.0)  # of lengths by the crank's
FAR = 1e3  # of the path's size: the miss of a shape that does not close
ALIKE = 1e-4  # of the path's size: two designs are one


@dataclass(frozen=True, repr=False)
class Design(TextReport):
    """A mechanism that was found.

    Attributes
    ----------
    graph : the mechanism; `Graph.save` writes it, the studio opens it
    at : (n,) coordinates [rad] of the driver at the positions
    output : name of the output that was asked for
    errors : (n,) [m or rad] distance from the positions
    """

    graph: Graph
    at: Floats
    output: str
    errors: Floats

    @property
    def miss(self) -> float:
        """The largest of the errors."""
        return float(self.errors.max())

    def text(self, degrees: bool = DEGREES) -> str:
        """The miss, and where the driver stands at the positions."""
        at = np.degrees(self.at) if degrees else self.at
        places = ", ".join(f"{q:.6g}" for q in at)
        unit = "deg" if degrees else "rad"
        return f"{self.output}: largest miss {self.miss:.6g}, at {places} {unit}"

    def to_dict(self) -> dict[str, Any]:
        """The design as a JSON object."""
        found = {"output": self.output, "at": self.at.tolist(), "errors": self.errors.tolist()}
        return as_data({**found, "graph": self.graph.to_data()})


@dataclass(frozen=True, repr=False)
class Synthesis(TextReport, Sequence[Design]):
    """Designs that were found, the best first.

    Attributes
    ----------
    found : the designs
    tried : shapes that were tried
    left_out : designs that change circuit or branch on the way, or take the positions in another
        order
    """

    found: tuple[Design, ...]
    tried: int
    left_out: int

    def __getitem__(self, index: Any) -> Any:
        return self.found[index]

    def __len__(self) -> int:
        return len(self.found)

    def text(self, degrees: bool = DEGREES) -> str:
        """The designs, one a line."""
        rows = [(str(i), f"{d.miss:.6g}") for i, d in enumerate(self.found)]
        said = f"{self.tried} shapes tried, {self.left_out} left out for circuit, branch or order"
        return "\n".join([*aligned(("design", "largest miss"), rows), said])

    def to_dict(self) -> dict[str, Any]:
        """The designs as a JSON object."""
        rows = [d.to_dict() for d in self.found]
        return {"designs": rows, "tried": self.tried, "left_out": self.left_out}


# -- four-bar, closed form -----------------------------------------------------------------


def coupler_point(shape: Any, theta: Any, branch: Any) -> Any:
    """Coupler point of a four-bar with crank 1 and its pivot at zero; NaN where it is open.

    shape : frame and its angle, coupler, rocker (logarithms of lengths), u, v of the point
    """
    frame, turn, coupler, rocker, u, v = shape
    D = np.exp(frame + 1j * turn)
    l, m = np.exp(coupler), np.exp(rocker)
    B = np.exp(1j * theta)
    d = D - B
    r2 = np.abs(d) ** 2
    a = (r2 + l**2 - m**2) / (2 * r2)
    with np.errstate(invalid="ignore"):
        h = np.sqrt(l**2 / r2 - a**2)
    e = d * (a + 1j * branch * h) / l
    return B + (u + 1j * v) * e


def fourbar(
    shape: Sequence[float], A: complex, B: complex, branch: int, name: str = "fourbar"
) -> Graph:
    """The graph of a four-bar: its shape with crank 1, then turned, scaled and moved."""
    frame, turn, coupler, rocker, u, v = (float(x) for x in shape)
    size, angle = abs(A), cmath.phase(A)
    D = B + A * cmath.exp(frame + 1j * turn)
    point = {"P": {"at": [size * u, size * v]}}
    return Graph.from_data(
        {
            "format": "blockmech/graph",
            "version": 1,
            "name": name,
            "blocks": {
                "frame": {
                    "type": "frame",
                    "markers": {"A": {"at": [B.real, B.imag]}, "D": {"at": [D.real, D.imag]}},
                },
                "crank": {"type": "driver.crank", "length": size, "offset": angle},
                "dyad": {
                    "type": "dyad.rrr",
                    "l_i": size * math.exp(coupler),
                    "l_j": size * math.exp(rocker),
                    "branch": branch,
                    "links": {"i": {"markers": point}},
                },
            },
            "wires": [
                {"from": "frame.A", "to": "crank.A"},
                {"from": "crank.B", "to": "dyad.B"},
                {"from": "frame.D", "to": "dyad.D"},
            ],
            "scene": {"drive": {"crank": {"law": "constant_rate", "rate": 1.0}}},
        }
    )


def _similar(c: Points, P: Points) -> tuple[Points, Points, Floats]:
    """The best A, B of P = A c + B for shapes c (m, n), and the mean square of what is left."""
    middle, centre = c.mean(axis=-1, keepdims=True), P.mean()
    z, p = c - middle, P - centre
    with np.errstate(all="ignore"):
        A = (np.conj(z) * p).sum(axis=-1) / (np.abs(z) ** 2).sum(axis=-1)
        left = (np.abs(p - A[..., None] * z) ** 2).mean(axis=-1)
    return A, centre - A * middle[..., 0], np.where(np.isfinite(left), left, np.inf)


@declared
def path_generator(
    points: Any,
    angles: Any = None,
    *,
    count: int = 5,
    starts: int = STARTS,
    seed: int = 0,
    progress: Progress | None = None,
) -> Synthesis:
    """Four-bars whose coupler point passes through points, the best first.

    Parameters
    ----------
    points : (n,) complex [m], or (n, 2), in the order in which they are passed
    angles : (n,) [rad] that the crank turns to at them, counted from any start; by default the
        timing is free
    count : designs that are returned
    starts : shapes that are tried, a power of two
    seed : of the shapes
    progress : told how far it is: ``progress(what, done, whole)``

    Returns
    -------
    Synthesis of `Design`, whose output is ``dyad.P.p`` of the graph

    Raises `RequestError` for fewer than three points, or angles that do not rise or fall.

    >>> found = path_generator([0.0, 1.0 + 0.2j, 2.0, 3.0 - 0.1j], starts=256)
    >>> found[0].graph.name
    'path_generator'
    """
    from scipy.stats import qmc

    P, theta = _asked(points, angles)
    size = float(np.abs(P - P.mean()).max())
    draw = qmc.Sobol(8, seed=np.random.default_rng(seed)).random_base2(round(math.log2(starts)))
    lengths = LOW + (HIGH - LOW) * draw[:, [0, 2, 3]]
    turn = math.tau * draw[:, 1]
    uv = 6.0 * draw[:, 4:6] - 3.0
    rows = np.column_stack([lengths[:, 0], turn, lengths[:, 1], lengths[:, 2], uv])
    branch = np.where(draw[:, 6] < 0.5, 1, -1)
    way = np.ones(starts) if theta is not None else np.where(draw[:, 7] < 0.5, 1.0, -1.0)
    at = np.tile(theta if theta is not None else np.zeros(len(P)), (len(rows), 1))
    if theta is None:  # angles in proportion to the way along the points, over a part of a turn
        along = np.append(0.0, np.cumsum(np.abs(np.diff(P))))
        part = 0.15 + 0.83 * ((draw[:, 7] * 2) % 1)
        at = (way * part)[:, None] * math.tau * along / along[-1]
    c = coupler_point(rows.T[..., None], at, branch[:, None])
    left = _similar(c, P)[2]
    order = np.argsort(left, kind="stable")[:REFINED]
    found: list[Design] = []
    left_out = 0
    for done, i in enumerate(order.tolist()):
        if progress is not None:
            progress(f"{done} of {REFINED} designs refined", done, REFINED)
        if not math.isfinite(left[i]):
            continue
        made = _refined(rows[i], at[i], int(branch[i]), P, theta is None, size)
        if made is None:
            left_out += 1
        elif all(
            np.abs(made.at - d.at).max() + abs(made.miss - d.miss) / size > ALIKE for d in found
        ):
            found.append(made)
    best = sorted(found, key=lambda d: d.miss)[:count]
    return Synthesis(tuple(best), starts, left_out)


def _asked(points: Any, angles: Any) -> tuple[Points, Floats | None]:
    """Points and angles of a request. Raises `RequestError` for what is none."""
    try:
        P = np.asarray(points)
        P = P[:, 0] + 1j * P[:, 1] if P.ndim == 2 and P.shape[1] == 2 else P.astype(complex)
        theta = None if angles is None else np.asarray(angles, float)
    except (TypeError, ValueError, IndexError):
        raise refused(
            "points", f"got {points!r:.60}", "give complex numbers, or rows x, y"
        ) from None
    if P.ndim != 1 or len(P) < 3 or not np.isfinite(P).all() or not np.ptp(np.abs(P - P[0])) > 0:
        raise refused("points", f"got {points!r:.60}", "give three points or more")
    if theta is None:
        return P, None
    steps = np.diff(theta)
    if theta.shape != P.shape or not ((steps > 0).all() or (steps < 0).all()):
        raise refused("angles", f"got {angles!r:.60}", "one for each point, rising or falling")
    return P, theta


def _refined(
    row: Floats, theta: Floats, branch: int, P: Points, free: bool, size: float
) -> Design | None:
    """The design near a shape with all its numbers free; None where it has a defect."""
    from scipy.optimize import least_squares

    c = coupler_point(row, theta, branch)
    A, B, _ = _similar(c[None], P)
    start = np.array([*row, A[0].real, A[0].imag, B[0].real, B[0].imag])
    start = np.append(start, theta) if free else start
    k = len(row) + 4

    def miss(x: Floats) -> Points:
        at = x[k:] if free else theta
        found = complex(x[6], x[7]) * coupler_point(x[:6], at, branch) + complex(x[8], x[9])
        return np.asarray(np.where(np.isfinite(found), found - P, FAR * size))

    def residual(x: Floats) -> Floats:
        z = miss(x)
        return np.concatenate([z.real, z.imag]) / size

    x = least_squares(
        residual, start, method="trf", x_scale="jac", xtol=1e-15, ftol=1e-15, max_nfev=400
    ).x
    at = x[k:] if free else theta
    steps = np.diff(at)
    way = np.linspace(at[0], at[-1], CHECKED)
    between = coupler_point(x[:6], way, branch)
    ordered = (steps > 0).all() or (steps < 0).all()
    if not (ordered and np.isfinite(between).all() and abs(at[-1] - at[0]) < math.tau):
        return None
    graph = fourbar(x[:6], complex(x[6], x[7]), complex(x[8], x[9]), branch, "path_generator")
    return Design(graph, np.asarray(at), "dyad.P.p", np.abs(miss(x)))


@declared
def three_positions(positions: Any, moving: Any, *, name: str = "three_positions") -> Design:
    """The four-bar whose coupler passes three positions: its pivots on the frame.

    Parameters
    ----------
    positions : three of (x, y, angle) [m, rad] of the coupler's own axes
    moving : two points [m], complex, in the coupler's axes: its pins to crank and rocker

    Returns
    -------
    Design, whose graph has the coupler's axes as link i of ``dyad``, and its origin as ``dyad.P``

    Raises `RequestError` where a pin's three places lie on a straight line, or where the way
    through the positions changes circuit, branch or order.
    """
    rows = np.asarray(positions, float)
    pins = np.asarray(moving, complex)
    if rows.shape != (3, 3) or pins.shape != (2,) or not abs(pins[1] - pins[0]) > 0:
        raise refused("positions", "three of x, y, angle and two points are meant")
    origin, turn = rows[:, 0] + 1j * rows[:, 1], np.exp(1j * rows[:, 2])
    places = origin + turn * pins[:, None]
    centres = [_centre(z) for z in places]
    for which, z in zip(("crank", "rocker"), centres, strict=True):
        if z is None:
            raise refused(which, "its three places lie on a straight line", "take another point")
    A, D = (complex(z) for z in centres if z is not None)
    crank = complex(places[0, 0] - A)
    arm, link = places[1, 0] - D, pins[1] - pins[0]
    sides = np.sign(((places[1] - places[0]).conj() * (D - places[0])).imag)
    theta = np.unwrap(np.angle((places[0] - A) / crank))
    u = -pins[0] / link * abs(link)
    scale = abs(crank)
    shape = [
        math.log(abs(D - A) / scale), cmath.phase((D - A) / crank), math.log(abs(link) / scale),
        math.log(abs(arm) / scale), u.real / scale, u.imag / scale,
    ]  # fmt: skip
    branch = -int(sides[0]) or 1
    steps, way = np.diff(theta), np.linspace(theta[0], theta[2], CHECKED)
    whole = np.isfinite(coupler_point(shape, way, branch)).all()
    if len(set(sides.tolist())) > 1 or not whole or steps[0] * steps[1] <= 0:
        found = "on the way through the positions it changes circuit, branch or order"
        raise refused("moving", found, "take other points of the coupler")
    graph = fourbar(shape, crank, A, branch, name)
    at = coupler_point(shape, theta, branch) * crank + A
    return Design(graph, theta, "dyad.P.p", np.abs(at - origin))


def _centre(z: Points) -> complex | None:
    """Centre of the circle through three points; None where they lie on a line."""
    a, b = z[1] - z[0], z[2] - z[0]
    area = 2 * float((a.conjugate() * b).imag)
    if abs(area) <= 1e-12 * abs(a) * abs(b):
        return None
    return complex(z[0] + 1j * (abs(b) ** 2 * a - abs(a) ** 2 * b) / area)


def saved(found: Synthesis, folder: Any) -> Iterator[Any]:
    """Write the designs as files ``design_0.json``, ... into a folder, and give their paths."""
    from pathlib import Path

    Path(folder).mkdir(parents=True, exist_ok=True)
    for i, design in enumerate(found):
        path = Path(folder) / f"design_{i}.json"
        design.graph.save(path)
        yield path
