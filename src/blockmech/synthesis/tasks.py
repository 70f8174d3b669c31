"""Tasks of synthesis: four-bars that generate a function or a path, or guide a body.

Function generation: the rocker follows a function of the crank's angle.
Freudenstein's equation of a four-bar with frame 1 between the fixed pivots,

    K1 cos psi - K2 cos phi + K3 = cos(phi - psi),

is linear in K1 = frame/crank, K2 = frame/rocker, K3; where both angles are counted from is
sampled, and five positions are met exactly where they can be. The best are refined in what
counts, the angle of the rocker.

Body guidance: the coupler passes three to five positions (Burmester).
Position j takes a point w of the body in its first position to z_j = o_j + e_j w (o_1 = 0,
e_1 = 1). A pin w with the pivot m on the frame keeps its distance, |z_j - m| = |w - m|:

    |o_j|^2 + 2 Re(conj(o_j) e_j w) - 2 Re(conj(o_j) m) - 2 Re((e_j - 1) w conj(m)) = 0.

That is linear in the six numbers w, m and w conj(m). Five positions leave a plane of solutions,
and w conj(m) being the product of w and conj(m) two conics in it: they meet in the at most four
pins of Burmester. Each position less is a condition that can be chosen; a linear one, drawn at
random, gives points of the circle-point curve (four positions) or of the plane (three) by the
same algebra.

Sources: Freudenstein, Trans. ASME 77 (1955); Hartenberg & Denavit, Kinematic Synthesis of
Linkages, 1964, ch. 10;
Burmester, Lehrbuch der Kinematik, 1888; Sandor & Erdman, Advanced Mechanism Design,
vol. 2, ch. 3; McCarthy & Soh, Geometric Design of Linkages, 2nd ed., ch. 5.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from blockmech.ground.arguments import declared
from blockmech.ground.errors import refused
from blockmech.ground.progress import with_bar
from blockmech.ground.tolerances import BLUR, DOUBLE_ROOT
from blockmech.ground.values import POSE
from blockmech.synthesis.designs import (
    ALIKE,
    Design,
    Synthesis,
    design_of_path,
    fourbar,
    proposed,
)
from blockmech.synthesis.fourbar import SHAPE, angles_and_point, coupler_point
from blockmech.synthesis.search import STARTS, Task, monotonic, numbers_in_si, path_of, points_of
from blockmech.typing import Array, Floats, Numbers, Points, Progress, Vectors

TRIED = 32  # conditions that are drawn where positions are lacking
CLOSE = DOUBLE_ROOT  # relative: misfit of a pin's conditions, and two pins that are one


@with_bar
@declared
def body_guidance(
    positions: Sequence[Sequence[float]] | Array,
    *,
    count: int = 5,
    tried: int = TRIED,
    seed: int = 0,
    progress: Progress | None = None,
) -> Synthesis:
    """Four-bars whose coupler passes positions, those with the best transmission first.

    Three to five positions are met exactly where a four-bar without defects can; where none can,
    and for more positions, the nearest designs are given.

    Parameters
    ----------
    positions : three and more of (x, y, angle) [m, m, rad] of the body's own axes
    count : designs that are returned
    tried : random conditions on pins, where three or four positions leave a choice
    seed : of these
    progress : called as ``progress(task, completed, total)``

    Returns
    -------
    Synthesis of `Design`, whose graph has the body as link i of ``dyad`` and its origin as
    ``dyad.P``. The error of a position is the distance of the origin and, of those that are not
    met exactly, the angle times the size of the travel

    Raises `RequestError` for fewer than three positions, or invalid ones

    >>> found = body_guidance([(0.0, 0.0, 0.1), (1.0, 0.5, 0.5), (1.6, 1.4, 1.0)], tried=8)
    >>> found[0].miss < 1e-9
    True
    """
    rows, name = _positions(positions, None), "body_guidance"
    if len(rows) > 5:
        return _near(rows, name, count, seed, progress)
    size = _size(rows)
    ways = 1 if len(rows) == 5 else tried
    rng = np.random.default_rng(seed)
    pins: list[tuple[complex, complex]] = []
    for i in range(ways):
        if progress is not None:
            progress(f"{len(pins)} pins", i, ways)
        pins += [
            pin
            for pin in burmester_pins(rows, rng)
            if all(abs(pin[0] - w) + abs(pin[1] - m) > CLOSE * size for w, m in pins)
        ]
    pairs = [
        (first, second)
        for first, second in itertools.permutations(pins, 2)
        if min(abs(first[0] - second[0]), abs(first[1] - second[1]), abs(first[0] - first[1]))
        > CLOSE * size
    ]
    fourbars, sound, margins = _judged(rows, pairs)
    chosen: list[int] = []
    for i in np.argsort(-np.where(sound, margins, 0.0), kind="stable").tolist():
        if len(chosen) == count or not sound[i]:
            break
        if all(abs(margins[i] - margins[j]) > ALIKE * margins[i] for j in chosen):
            chosen.append(i)
    designs = tuple(_design(rows, fourbars, i, float(margins[i]), name) for i in chosen)
    if designs:
        return Synthesis(designs, len(pairs), int((~sound).sum()))
    return _near(rows, name, count, seed, progress)


def _near(rows: Floats, name: str, count: int, seed: int, progress: Progress | None) -> Synthesis:
    """Four-bars that come as near to positions as any, by least squares."""
    task = Task(points=rows[:, 0] + 1j * rows[:, 1], turns=rows[:, 2])

    def made(x: Floats, branch: int, margin: float) -> Design:
        design = design_of_path(task, name, x, branch, margin)
        _, coupler, _ = angles_and_point(x[:SHAPE], design.at, np.asarray(branch))
        turned = np.abs(np.angle(np.exp(1j * (coupler + x[SHAPE + 4] - rows[:, 2]))))
        return replace(design, errors=design.errors + task.size * turned)

    return proposed(task, count, STARTS, seed, progress, made)


@declared
def three_positions(positions: Any, moving: Points, *, name: str = "three_positions") -> Design:
    """The four-bar whose coupler passes three positions with two pins that are chosen.

    Parameters
    ----------
    positions : three of (x, y, angle) [m, rad] of the coupler's own axes
    moving : two points in the coupler's axes, its pins to crank and rocker: complex [m], or rows
        x, y, numbers or texts such as "80mm"

    Returns
    -------
    Design, whose graph has the coupler as link i of ``dyad``, and its origin as ``dyad.P``

    Raises `RequestError` where a pin's three positions lie on a straight line, or where the motion
    through the positions changes circuit, branch or order.

    >>> positions = [(0.0, 1.0, 0.0), (0.5, 1.2, 0.3), (1.0, 1.0, 0.6)]
    >>> bm.synthesis.three_positions(positions, moving=[0j, 1 + 0j])
    <Design: dyad.P.p: largest miss 1.11022e-16, least margin 0.104, at 0, -0.761013, -1.52203 rad>
    """
    rows = _positions(positions, 3)
    remedy = "give two points of the coupler"
    pins = points_of("moving", moving, remedy)
    if pins.shape != (2,) or not abs(pins[1] - pins[0]) > 0:
        raise refused("moving", f"got {moving!r:.60}", remedy)
    origin, turn = rows[:, 0] + 1j * rows[:, 1], np.exp(1j * rows[:, 2])
    centres = [_centre(origin + turn * w) for w in pins]
    for which, z in zip(("crank", "rocker"), centres, strict=True):
        if z is None:
            raise refused(which, "its three positions lie on a straight line", "take another point")
    w = origin[0] + turn[0] * pins
    fourbars, sound, margins = _judged(rows, [[(w[i], centres[i]) for i in (0, 1)]])
    if not sound[0]:
        message = "on the way through the positions it changes circuit, branch or order"
        raise refused("moving", message, "take other points of the coupler")
    return _design(rows, fourbars, 0, float(margins[0]), name)


def _positions(positions: Any, maximum: int | None) -> Floats:
    """Rows (n, 3) of x, y [m], angle [rad]. Raises `RequestError` for others."""
    remedy = f"give 3{'' if maximum else ' or more'} rows x, y, angle"
    rows = numbers_in_si("positions", positions, remedy, *POSE)
    if rows.ndim != 2 or not 3 <= len(rows) <= (maximum or len(rows)):
        raise refused("positions", f"got {positions!r:.60}", remedy)
    if not _size(rows) > 0:
        raise refused("positions", "they are all the same", "give positions that differ")
    return rows


def _size(rows: Floats) -> float:
    """Size of what is wanted: travel of the origin [m], or 1 where the body only turns."""
    travel = float(np.abs(np.ptp(rows[:, :2], axis=0)).max())
    return travel or float(np.ptp(rows[:, 2]) > 0)


def burmester_pins(rows: Floats, rng: np.random.Generator) -> list[tuple[complex, complex]]:
    """Pins of a body that passes three to five positions on circles, and the circles' centres.

    Parameters
    ----------
    rows : (n, 3) of x, y [m], angle [rad]
    rng : draws one linear condition on pin and centre for each position short of five

    Returns
    -------
    Pairs (w, m) [m]: the pin in the first position, in the frame's axes, and its centre

    >>> positions = [(0.0, 1.0, 0.0), (0.5, 1.2, 0.3), (1.0, 1.0, 0.6)]
    >>> pins = bm.synthesis.burmester_pins(np.array(positions), np.random.default_rng(1))
    >>> len(pins)
    4
    """
    scale, origin = _size(rows), complex(*rows[0, :2])
    e = np.exp(1j * (rows[1:, 2] - rows[0, 2]))
    z = (rows[1:, 0] + 1j * rows[1:, 1] - origin) / scale
    # unknowns: w, m and p = w conj(m) as real and imaginary parts, all by the scale
    c = e - 1.0
    M = np.column_stack(
        [
            2 * (z.conj() * e).real, -2 * (z.conj() * e).imag, -2 * z.real, -2 * z.imag,
            -2 * c.real, 2 * c.imag,
        ]
    )  # fmt: skip
    b = -(np.abs(z) ** 2)
    lacking = 4 - len(z)
    chosen = np.column_stack([rng.normal(size=(lacking, 4)), np.zeros((lacking, 2))])
    M, b = np.vstack([M, chosen]), np.append(b, 2 * rng.normal(size=lacking))
    _, sizes, vt = np.linalg.svd(M)
    if not sizes[-1] > CLOSE * sizes[0]:
        return []
    start, basis = np.linalg.lstsq(M, b, rcond=None)[0], vt[4:]
    pins = []
    for s, t in _conics_meet(*(_product(start, basis, part) for part in ("real", "imag"))):
        x = start + s * basis[0] + t * basis[1]
        w, m = complex(x[0], x[1]), complex(x[2], x[3])
        if abs(w * m.conjugate() - complex(x[4], x[5])) <= CLOSE * (1 + abs(w) * abs(m)):
            pins.append((w * scale + origin, m * scale + origin))
    return pins


def _product(start: Floats, basis: Floats, part: str) -> Floats:
    """The conic (3, 3) in (1, s, t) that says that p is the product of w and conj(m)."""
    rows = np.vstack([start, basis])
    w, m = rows[:, 0] + 1j * rows[:, 1], rows[:, 2] + 1j * rows[:, 3]
    products = w[:, None] * m.conj()[None, :]
    linear = np.zeros((3, 3), complex)
    linear[0] = rows[:, 4] + 1j * rows[:, 5]
    conic = (products + products.T) / 2 - (linear + linear.T) / 2
    return np.asarray(getattr(conic, part))


def _conics_meet(A: Floats, B: Floats) -> list[tuple[float, float]]:
    """Real points (s, t) in which two conics x^T A x = x^T B x = 0, x = (1, s, t), meet.

    As quadratics in t their resultant is a quartic in s.
    """
    P = np.polynomial.Polynomial
    q = [
        (P([Q[2, 2]]), P([2 * Q[0, 2], 2 * Q[1, 2]]), P([Q[0, 0], 2 * Q[0, 1], Q[1, 1]]))
        for Q in (A, B)
    ]
    (a2, a1, a0), (b2, b1, b0) = q
    across, slope = a2 * b0 - a0 * b2, a2 * b1 - a1 * b2
    quartic: Any = across**2 - slope * (a1 * b0 - a0 * b1)
    points = []
    for root in quartic.roots().tolist():
        s = complex(root)
        if abs(s.imag) > BLUR * (1 + abs(s)) or not abs(slope(s.real)) > 0:
            continue
        x = np.array([1.0, s.real, -across(s.real) / slope(s.real)], float)
        for _ in range(4):  # Newton's steps take away the rounding of the quartic
            F = np.array([x @ A @ x, x @ B @ x])
            J = 2 * np.array([(A @ x)[1:], (B @ x)[1:]])
            x[1:] -= np.linalg.lstsq(J, F, rcond=None)[0]
        points.append((float(x[1]), float(x[2])))
    return points


class _FourBars(NamedTuple):
    """Four-bars (m) in their first position: shape, crank angles, branch, crank, its pivot."""

    shape: Floats  # (m, 6)
    theta: Floats  # (m, n)
    branch: Array  # (m,)
    crank: Vectors  # (m,)
    pivot: Vectors  # (m,)


def _judged(rows: Floats, pairs: Sequence[Any]) -> tuple[_FourBars, Any, Floats]:
    """The four-bars of pairs of pins, whether they have no defect, and their least margins."""
    ends = np.array(pairs, complex).reshape(-1, 2, 2)  # pair, pin, (place, centre)
    (w, A), (v, D) = ends[:, 0].T, ends[:, 1].T
    crank, link, arm = w - A, v - w, v - D
    scale = np.abs(crank)
    origin, turn = rows[:, 0] + 1j * rows[:, 1], np.exp(1j * (rows[:, 2] - rows[0, 2]))
    first, second = (origin + turn * (z[:, None] - origin[0]) for z in (w, v))
    sides = np.sign(((second - first).conj() * (D[:, None] - first)).imag)
    theta = np.unwrap(np.angle((first - A[:, None]) / crank[:, None]), axis=1)
    uv = (origin[0] - w) / link * np.abs(link) / scale
    shape = np.column_stack(
        [
            np.log(np.abs(D - A) / scale), np.angle((D - A) / crank),
            np.log(np.abs(link) / scale), np.log(np.abs(arm) / scale), uv.real, uv.imag,
        ]
    )  # fmt: skip
    branch = np.where(sides[:, 0] > 0, -1, 1)
    x = np.hstack([shape, np.zeros((len(shape), 5)), theta])
    sound, margins = np.zeros(len(x), bool), np.zeros(len(x))
    same = np.flatnonzero((sides == sides[:, :1]).all(axis=1))
    sound[same], margins[same] = Task(turns=rows[:, 2]).sound(x[same], branch[same])
    return _FourBars(shape, theta, branch, crank, A), sound, margins


def _design(rows: Floats, fourbars: _FourBars, i: int, margin: float, name: str) -> Design:
    shape, theta, branch, crank, pivot = (x[i] for x in fourbars)
    at = coupler_point(shape, theta, branch) * crank + pivot
    errors = np.abs(at - rows[:, 0] - 1j * rows[:, 1])
    graph = fourbar(shape, complex(crank), complex(pivot), int(branch), name)
    return Design(graph, theta, "dyad.P.p", errors, margin)


def _centre(z: Vectors) -> complex | None:
    """Centre of the circle through three points; None where they lie on a line."""
    a, b = z[1] - z[0], z[2] - z[0]
    area = 2 * float((a.conjugate() * b).imag)
    if abs(area) <= 1e-12 * abs(a) * abs(b):
        return None
    return complex(z[0] + 1j * (abs(b) ** 2 * a - abs(a) ** 2 * b) / area)


@with_bar
@declared
def function_generator(
    inputs: Numbers,
    outputs: Numbers,
    *,
    count: int = 5,
    starts: int = STARTS,
    seed: int = 0,
    progress: Progress | None = None,
) -> Synthesis:
    """Four-bars whose rocker has wanted angles at angles of the crank, the best first.

    Parameters
    ----------
    inputs : (n,) [rad] of the crank, rising or falling: coordinates of the driver
    outputs : (n,) [rad] of the rocker: ``dyad.j.angle``. The orientation of the linkage is free,
        so only their differences count
    count, starts, seed, progress : as those of `path_generator`

    Returns
    -------
    Synthesis of `Design`, whose output is ``dyad.j.angle`` of the graph, errors in rad; the frame
    is 1 m long, as lengths do not count

    Raises `RequestError` for fewer than three positions, or inputs that do not rise or fall.

    >>> found = function_generator([0.0, 0.4, 0.9, 1.3], [0.0, 0.1, 0.4, 0.8], starts=256)
    >>> found[0].output
    'dyad.j.angle'
    """
    remedy = "give three angles or more"
    psi = numbers_in_si("outputs", outputs, remedy, "rad")
    if psi.ndim != 1 or len(psi) < 3 or not np.ptp(psi) > 0:
        raise refused("outputs", f"got {outputs!r:.60}", remedy)
    phi = monotonic("inputs", inputs, len(psi))
    task = Task(swings=psi, angles=phi)
    name = "function_generator"

    def made(x: Floats, branch: int, margin: float) -> Design:
        zero, scale = x[SHAPE + 4], np.exp(-x[0])
        rocker = angles_and_point(x[:SHAPE], phi, np.asarray(branch))[2] + zero
        errors = np.abs(np.angle(np.exp(1j * (rocker - psi))))
        graph = fourbar(x[:4], complex(scale * np.exp(1j * zero)), 0j, branch, name)
        return Design(graph, phi, "dyad.j.angle", errors, margin)

    return proposed(task, count, starts, seed, progress, made)


@with_bar
@declared
def path_generator(
    points: Points,
    angles: Numbers | None = None,
    *,
    count: int = 5,
    starts: int = STARTS,
    seed: int = 0,
    progress: Progress | None = None,
) -> Synthesis:
    """Four-bars whose coupler point passes through points, the best first.

    Parameters
    ----------
    points : (n,) complex [m], or (n, 2), numbers or texts such as "80mm", in the order in which
        they are passed; where the last is the first, the crank makes a full turn
    angles : (n,) [rad] that the crank turns to at them, counted from any start; by default the
        timing is free
    count : designs that are returned
    starts : shapes that are tried
    seed : of the shapes
    progress : called as ``progress(task, completed, total)``

    Returns
    -------
    Synthesis of `Design`, whose output is ``dyad.P.p`` of the graph

    Raises `RequestError` for fewer than three points, or angles that do not rise or fall.

    >>> found = path_generator([0.0, 1.0 + 0.2j, 2.0, 3.0 - 0.1j], starts=256)
    >>> found[0].graph.name
    'path_generator'
    """
    P, theta = path_of(points, angles)
    closed = theta is None and abs(P[-1] - P[0]) <= 1e-12 * float(np.abs(P).max())
    task = Task(points=P, angles=theta, closed=bool(closed))
    name = "path_generator"
    return proposed(
        task, count, starts, seed, progress, lambda *row: design_of_path(task, name, *row)
    )
