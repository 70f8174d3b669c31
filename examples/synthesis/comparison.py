"""Five published tasks of synthesis: blockmech beside pylinkage and differential evolution.

Each task is solved by `blockmech.synthesis`, by pylinkage's own synthesis, by pylinkage's
differential evolution on its linkage, and by `scipy.optimize.differential_evolution` on
`mech.objective`. The two searches get ten times the time that blockmech took, and the best they
had in its own time is noted, too. Errors of all are measured alike, by this file's own four-bar
and not by either package: the largest distance from a wanted point (of timed paths at the wanted
angles; of others from the curve, whose order they need not keep), or the largest error of the
rocker's angle.

    python examples/synthesis/comparison.py [task ...]

needs ``pip install pylinkage``.

Tasks
-----
ellipse : ten points, the last the first: Acharyya & Mandal, Mech. Mach. Theory 44 (2009) 1784
line : six points of a straight line: Cabrera, Simon & Prado, Mech. Mach. Theory 37 (2002) 1165
function : y = sin x, 0 to 90 degrees, crank 120 degrees, rocker 60, ten positions: Freudenstein,
    Trans. ASME 77 (1955) 853
positions : three positions of a body: Sandor & Erdman, Advanced Mechanism Design 2 (1984), 2.14
timed : five points with the crank's angles: Cabrera, Simon & Prado 2002, second case
"""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution

import blockmech as bm

X_ELLIPSE = np.array([20, 17.66, 11.736, 5, 0.60307, 0.60307, 5, 11.736, 17.66, 20])
Y_ELLIPSE = np.array([10, 15.142, 17.878, 16.928, 12.736, 7.2638, 3.0718, 2.1215, 4.8577, 10])
ELLIPSE = X_ELLIPSE + 1j * Y_ELLIPSE
LINE = 20 + 1j * np.arange(20.0, 46.0, 5.0)
TIMED = np.array([3 + 3j, 2.759 + 3.363j, 2.372 + 3.663j, 1.89 + 3.862j, 1.355 + 3.943j])
TIMES = np.pi * np.array([1 / 6, 1 / 4, 1 / 3, 5 / 12, 1 / 2])
X = np.linspace(0.0, math.pi / 2, 10)
INPUTS, OUTPUTS = np.radians(120) * X / X[-1], np.radians(60) * np.sin(X)
POSITIONS = [(0.0, 0.0, 0.1), (1.0, 0.5, 0.5), (1.6, 1.4, 1.0)]
FINE = np.linspace(0.0, math.tau, 7201)
COARSE = np.linspace(0.0, math.tau, 97)


# -- how errors are measured ---------------------------------------------------------------


def coupler(numbers: Any, theta: Any) -> Any:
    """Coupler point at crank angles; numbers: A, D, crank, coupler, rocker, u, v, branch."""
    ax, ay, dx, dy, a, b, c, u, v, branch = numbers
    B = complex(ax, ay) + a * np.exp(1j * np.asarray(theta))
    d = complex(dx, dy) - B
    x = (b**2 - c**2 + np.abs(d) ** 2) / (2 * np.abs(d))
    with np.errstate(invalid="ignore"):
        e = d / np.abs(d) * (x + 1j * branch * np.sqrt(b**2 - x**2)) / b
    return B + (u + 1j * v) * e


def from_curve(path: Any, points: Any) -> Any:
    """Distances of points from a curve that is given by its corners."""
    a, b = path[:-1], path[1:]
    along = ((points[:, None] - a) * np.conj(b - a)).real / np.maximum(np.abs(b - a) ** 2, 1e-300)
    gaps = np.abs(points[:, None] - a - np.clip(along, 0, 1) * (b - a))
    return np.min(np.where(np.isfinite(gaps), gaps, 1e6), axis=1)


def numbers_of(graph: bm.Graph) -> list[float]:
    """A blockmech four-bar as numbers of this file; the crank's offset does not count."""
    p = {a: x.value for a, x in graph.compile().parameters().items()}
    names = ["frame.A.x", "frame.A.y", "frame.D.x", "frame.D.y", "crank.length"]
    names += ["dyad.l_i", "dyad.l_j", "dyad.P.x", "dyad.P.y", "dyad.branch"]
    return [p[n] for n in names]


# -- searches that are stopped by the clock ------------------------------------------------


class TimeUp(Exception):
    """The budget is spent."""


class Clock:
    """A function to be made least, with the best value that it had at each time."""

    def __init__(self, function: Callable[[Any], float], budget: float) -> None:
        self.function, self.budget, self.start = function, budget, time.perf_counter()
        self.trace = [(0.0, math.inf)]

    def __call__(self, x: Any) -> float:
        value = float(self.function(np.asarray(x)))
        now = time.perf_counter() - self.start
        if value < self.trace[-1][1]:
            self.trace.append((now, value))
        if now > self.budget:
            raise TimeUp
        return value

    def best(self, seconds: float) -> float:
        """The best value after a time."""
        return min(value for t, value in self.trace if t <= seconds)


def evolved(search: Callable[[Any], Any], function: Any, seconds: float) -> tuple[float, float]:
    """The best of a search in a time, and in ten times that."""
    clock = Clock(function, 10 * seconds)
    while time.perf_counter() - clock.start < clock.budget:  # again, where it has settled
        try:
            search(clock)
        except TimeUp:
            break
    return clock.best(seconds), clock.best(10 * seconds)


# -- the rivals ----------------------------------------------------------------------------


def box(points: Any) -> list[tuple[float, float]]:
    """Bounds of A, D, crank, coupler, rocker, u, v for a path."""
    size = float(np.abs(points - points.mean()).max())
    x, y = points.mean().real, points.mean().imag
    places = [(x - 6 * size, x + 6 * size), (y - 6 * size, y + 6 * size)] * 2
    return [*places, *[(0.1 * size, 6 * size)] * 3, *[(-6 * size, 6 * size)] * 2]


def scipy_on_objective(points: Any, angles: Any, seconds: float) -> tuple[float, float]:
    """Differential evolution on `mech.objective`."""
    low = bm.synthesis.fourbar([1.0, 0.3, 0.9, 1.0, 1.0, 0.5], 1.0, 0.0, 1)
    mech = low.compile()
    names = ["frame.A.x", "frame.A.y", "frame.D.x", "frame.D.y", "crank.length"]
    names += ["dyad.l_i", "dyad.l_j", "dyad.P.x", "dyad.P.y"]
    bounds = box(points)
    if angles is not None:  # where the crank's angle is counted from
        names, bounds = [*names, "crank.offset"], [*bounds, (-math.pi, math.pi)]
    at = COARSE if angles is None else angles
    f = mech.objective(names, want="poses(dyad.P.p)", at=at)

    def miss(x: Any) -> float:
        row = np.asarray(f(x))
        path = row[: len(at)] + 1j * row[len(at) :]
        if angles is None:
            return float(from_curve(path, points).max())
        return float(np.nan_to_num(np.abs(path - points), nan=1e6, posinf=1e6).max())

    return evolved(lambda c: differential_evolution(c, bounds, maxiter=10**6), miss, seconds)


def scipy_function(seconds: float) -> tuple[float, float]:
    """Differential evolution on `mech.objective` for the function generator."""
    mech = bm.synthesis.fourbar([0.0, 0.3, 0.0, 0.0, 0.0, 0.0], 1.0, 0.0, 1).compile()
    names = ["frame.D.x", "crank.length", "dyad.l_i", "dyad.l_j", "crank.offset"]
    f = mech.objective(names, want="poses(dyad.j.angle)", at=INPUTS)
    bounds = [(-5.0, 5.0), *[(0.1, 5.0)] * 3, (-math.pi, math.pi)]

    def miss(x: Any) -> float:
        gap = np.asarray(f(x)) - OUTPUTS
        turned = np.exp(1j * np.where(np.isfinite(gap), gap, 0.0))
        off = np.angle(turned / turned.mean())
        return float(np.where(np.isfinite(gap), np.abs(off), 1e6).max())

    return evolved(lambda c: differential_evolution(c, bounds, maxiter=10**6), miss, seconds)


def pylinkage_fourbar() -> Any:
    """A pylinkage four-bar with a coupler point whose frame is turned, scaled and moved, too."""
    from pylinkage.actuators import Crank
    from pylinkage.components import Ground
    from pylinkage.dyads import FixedDyad, RRRDyad
    from pylinkage.simulation import Linkage

    class Placed(Linkage):  # type: ignore[misc]
        """With four numbers more: where the plane of the linkage lies."""

        place = (1.0, 0.0, 0.0, 0.0)

        def get_constraints(self) -> list[float]:
            return [*super().get_constraints(), *self.place]

        def set_constraints(self, values: list[float]) -> None:
            super().set_constraints(list(values[:-4]))
            self.place = tuple(values[-4:])

    A, D = Ground(0.0, 0.0, name="A"), Ground(1.0, 0.0, name="D")
    crank = Crank(anchor=A, radius=0.3, angular_velocity=math.tau / 96, name="B")
    C = RRRDyad(anchor1=crank.output, anchor2=D, distance1=0.9, distance2=0.8, name="C")
    P = FixedDyad(anchor1=crank.output, anchor2=C, distance=0.7, angle=0.5, name="P")
    return Placed([A, D, crank, C, P], name="fourbar")


def pylinkage_evolution(points: Any, angles: Any, seconds: float) -> tuple[float, float]:
    """pylinkage's differential evolution on its own linkage, with its own simulation."""
    from pylinkage.optimization import differential_evolution_optimization

    linkage = pylinkage_fourbar()
    size, start = float(np.abs(points - points.mean()).max()), linkage.get_coords()
    steps = 96 if angles is None else round(math.tau / (angles[1] - angles[0]))
    lengths = len(linkage.get_constraints()) - 4
    low = [0.05] * lengths + [-6 * size] * 2 + [points.mean().real - 6 * size,
                                                points.mean().imag - 6 * size]  # fmt: skip
    high = [3.0] * lengths + [6 * size] * 2 + [points.mean().real + 6 * size,
                                               points.mean().imag + 6 * size]  # fmt: skip
    low[lengths - 1] = -math.pi  # the angle of the coupler point
    linkage.components[2].angular_velocity = math.tau / steps

    def miss(x: Any) -> float:
        try:
            linkage.set_constraints([float(v) for v in x])
            linkage.set_coords(start)
            loci = [pose[-1] for pose in linkage.step(iterations=steps + 1)]
        except Exception:  # the package has several ways to say that it cannot be built
            return 1e6
        path = np.array([complex(*z) if z[0] is not None else np.nan for z in loci])
        path = complex(x[-4], x[-3]) * path + complex(x[-2], x[-1])
        if angles is None:
            return float(from_curve(path, points).max())
        return float(np.nan_to_num(np.abs(path[: len(points)] - points), nan=1e6).max())

    def search(clock: Clock) -> None:
        differential_evolution_optimization(
            lambda _, x, __: clock(x), linkage, bounds=(low, high), order_relation=min,
            maxiter=10**6, verbose=False,
        )  # fmt: skip

    return evolved(search, miss, seconds)


def pylinkage_synthesis(task: str) -> tuple[float, str]:
    """Seconds that pylinkage's own synthesis takes, and the error of the best of its designs."""
    from pylinkage import synthesis as pl

    start = time.perf_counter()
    if task == "function":
        pairs = [*zip(INPUTS.tolist(), OUTPUTS.tolist(), strict=True)]
        found = pl.function_generation(pairs, require_grashof=False).raw_solutions
    elif task == "positions":
        poses = [pl.Pose(*row) for row in POSITIONS]
        found = pl.motion_generation(poses, require_grashof=False).raw_solutions
    elif task == "timed":
        rows = [(z.real, z.imag) for z in TIMED]
        found = pl.path_generation_with_timing(
            rows, TIMES.tolist(), require_grashof=False
        ).raw_solutions
    elif task == "line":
        rows = [(z.real, z.imag) for z in LINE]
        found = pl.path_generation(rows, require_grashof=False).raw_solutions
    else:  # ten points are 6^9 candidates, of which six took a minute
        return math.nan, "not tried: it grows with 6^n"
    seconds = time.perf_counter() - start
    return seconds, f"{len(found)} designs" if len(found) else "no design"


# -- the table -----------------------------------------------------------------------------


def ours(task: str) -> tuple[float, float]:
    """Seconds and largest error of blockmech's synthesis."""
    s = bm.synthesis
    calls: dict[str, Callable[[], Any]] = {
        "ellipse": lambda: s.path_generator(ELLIPSE),
        "line": lambda: s.path_generator(LINE),
        "function": lambda: s.function_generator(INPUTS, OUTPUTS),
        "positions": lambda: s.body_guidance(POSITIONS, tried=4),
        "timed": lambda: s.path_generator(TIMED, TIMES),
    }
    start = time.perf_counter()
    best = calls[task]()[0]
    seconds = time.perf_counter() - start
    if task in ("ellipse", "line"):
        points = ELLIPSE if task == "ellipse" else LINE
        path = coupler(numbers_of(best.graph), np.linspace(best.at[0], best.at[-1], 7201)
                       + best.graph.compile().parameters()["crank.offset"].value)  # fmt: skip
        return seconds, float(from_curve(path, points).max())
    if task == "timed":
        offset = best.graph.compile().parameters()["crank.offset"].value
        return seconds, float(np.abs(coupler(numbers_of(best.graph), TIMES + offset) - TIMED).max())
    return seconds, best.miss


def main(tasks: list[str]) -> None:
    """Solve the tasks, one line each."""
    warnings.simplefilter("ignore")
    bm.synthesis.path_generator(LINE, starts=64)  # imports
    paths: dict[str, Any] = {"ellipse": (ELLIPSE, None), "line": (LINE, None),
                             "timed": (TIMED, TIMES)}  # fmt: skip
    for task in tasks:
        seconds, error = ours(task)
        print(f"{task:10} blockmech            {seconds:7.2f} s  {error:9.2e}", flush=True)
        rivals: dict[str, Callable[[], tuple[float, float]]] = {}
        if task in paths:
            points, angles = paths[task]
            rivals["pylinkage, evolution"] = lambda p=points, a=angles, s=seconds: (
                pylinkage_evolution(p, a, s)
            )
            rivals["scipy on objective"] = lambda p=points, a=angles, s=seconds: scipy_on_objective(
                p, a, s
            )
        if task == "function":
            rivals["scipy on objective"] = lambda s=seconds: scipy_function(s)
        for name, rival in rivals.items():
            same, longer = rival()
            print(f"{'':10} {name:20} {seconds:7.2f} s  {same:9.2e}, in {10 * seconds:.0f} s "
                  f"{longer:9.2e}", flush=True)  # fmt: skip
        taken, words = pylinkage_synthesis(task)
        print(f"{'':10} pylinkage, synthesis {taken:7.2f} s  {words}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or ["ellipse", "line", "function", "positions", "timed"])
