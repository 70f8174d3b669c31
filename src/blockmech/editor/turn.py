"""The poses that the studio shows: a turn of the drivers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from blockmech.analysis.closure import travel as slide_travel
from blockmech.analysis.limits import Limits, limits
from blockmech.compiled import Compiled
from blockmech.draw.motion import Motion, moves, moves_of_result
from blockmech.draw.simulation import screen_time
from blockmech.exchange.page.files import SECONDS
from blockmech.figures.curves import abscissa
from blockmech.figures.panels import Abscissa
from blockmech.ground.limits import SEARCHED
from blockmech.model.laws_of_motion import OverRange
from blockmech.model.spots import marker_place
from blockmech.result.failures import why_not
from blockmech.result.samples import DEFAULT_SAMPLES
from blockmech.typing import Arguments, Array, Data, Floats


def turn(mechanism: Compiled, moved: str = "", at: Mapping[str, float] | None = None) -> Motion:
    """The motion over the laws of the drivers, or that of one driver while the others stay.

    Parameters
    ----------
    moved : the driver that moves over its `travel`; by default the first without a law
    at : driver -> coordinate [rad or m] of the others, and of ``moved`` where its turn begins;
        by default where their laws, or the scene, begin

    Raises `RequestError` where a law cannot be followed.
    """
    free = [d for d in mechanism.drivers if d not in mechanism.scene.drive]
    moved = moved if moved in mechanism.drivers else ""
    if not free and not moved:
        return moves(mechanism, samples=DEFAULT_SAMPLES)
    moved = moved or free[0]
    q0 = {d: (at or {}).get(d, _begin(mechanism, d)) for d in mechanism.drivers}
    q = np.linspace(*travel(mechanism, moved, q0), DEFAULT_SAMPLES)
    settings: Arguments = {"want": (), "on_gap": "mark", "friction": "none"}
    rows = {d: q if d == moved else np.full(q.shape, x) for d, x in q0.items()}
    return moves_of_result(mechanism.run(at=rows, rates=dict.fromkeys(rows, 0.0), **settings))


def _begin(mechanism: Compiled, driver: str) -> float:
    """Where a driver stands at first: where its law, or else the scene, begins."""
    scene = mechanism.scene
    law, begin = scene.drive.get(driver), scene.begin(driver)
    if law is not None and begin is None:
        begin = float(law.at_times(np.array([law.begin()]))[0][0])
    return begin or 0.0


def travel(mechanism: Compiled, driver: str, at: Mapping[str, float]) -> tuple[float, float]:
    """The range [rad or m] in which a driver is moved by hand while the others stay ``at``.

    That of its law, else the arc of `limits` it is on, within the scene's stops; of many groups
    the whole turn, with its gaps.
    """
    law, stops = mechanism.scene.drive.get(driver), mechanism.scene.stops.get(driver)
    if isinstance(law, OverRange):
        low, high = sorted((law.start, law.end))
    elif law is not None:
        q = law.at_times(law.begin() + np.linspace(0, law.duration(), DEFAULT_SAMPLES))[0]
        low, high = float(q.min()), float(q.max())
    if law is not None and low < high:
        return low, high
    q0, turns = at[driver], mechanism.structure.driver_joint(driver).rotary
    reach = np.inf if turns else slide_travel(mechanism, driver).size
    closure = _limits(mechanism, driver, {d: q for d, q in at.items() if d != driver})
    arc = closure and (closure.arc_at(q0) or next(iter(closure.arcs), None))
    if closure and arc and not closure.whole_turn:
        low, high = max(arc.start.q, -reach), min(arc.end.q, reach)
    elif turns:
        low, high = q0, q0 + 2 * np.pi
    else:
        low, high = (-reach, reach) if closure is None else (q0, q0)
    bounds = stops.bounds if stops is not None else (low, high)
    return max(low, bounds[0]), min(high, bounds[1])


def _limits(
    mechanism: Compiled, driver: str, fixed: Mapping[str, float], blocks: list[str] | None = None
) -> Limits | None:
    """The `limits` of a driver; None where there are too many groups to wait for them."""
    groups = [b for b in mechanism.structure.blocks.values() if b.closes]
    return limits(mechanism, driver, fixed, blocks=blocks) if len(groups) <= SEARCHED else None


def dead_centres(motion: Motion) -> tuple[tuple[float, str], ...]:
    """Where a motion of one driver passes the ends and change points of `limits`.

    Each with the sample, which may lie between two, and the name. A group whose margin is farther
    from 0 than it changes from sample to sample has no dead centre. Of more groups than
    `SEARCHED` none is told.
    """
    moved, *rest = [d for d, q in motion.q.items() if np.ptp(q)] or [""]
    margins = motion.quality.margin
    critical = [
        b for b, m in margins.items() if not np.min(m) > np.max(np.abs(np.diff(m)), initial=0)
    ]
    if not moved or rest or not critical:
        return ()
    mechanism, q = motion.mechanism, motion.q[moved]
    fixed = {d: float(x[0]) for d, x in motion.q.items() if d != moved}
    closure = _limits(mechanism, moved, fixed, critical)
    if closure is None:
        return ()
    ends = [end for arc in closure.arcs for end in (arc.start, *arc.change_points, arc.end)]
    events: set[tuple[float, str]] = set()
    for end in (end for end in ends if end.block):
        apart = q - end.q
        if closure.unit == "rad":
            apart = np.angle(np.exp(1j * apart))
        a, b = apart[:-1], apart[1:]
        passed = np.flatnonzero((a * b < 0) & (np.abs(b - a) < np.pi))
        samples = [*np.flatnonzero(apart == 0), *(passed + a[passed] / (a - b)[passed])]
        name = f"{mechanism._block_name(end.block)} {end.how}"
        events |= {(float(sample), name) for sample in samples}
    return tuple(sorted(events))


def fault_of(motion: Motion) -> str:
    """Why the first sample without an answer has none, as a sentence."""
    return why_not(motion.result.rerun("*.p"))


# -- as the page gets it ------------------------------------------------------------------


def along_of(motion: Motion) -> Abscissa:
    """What curves are drawn over, with the dead centres on it."""
    axis = abscissa(motion.result)
    samples = np.arange(len(motion.samples))
    events = [(float(np.interp(k, samples, axis.values)), name) for k, name in dead_centres(motion)]
    return replace(axis, events=tuple(events))


def simulated_time(motion: Motion) -> Floats | None:
    """The times [s] of a motion under loads; a turn of the drivers has none."""
    return None if motion.result.motion is None else motion.time


def seconds_of(motion: Motion) -> float:
    """How long [s] a motion is played."""
    time = simulated_time(motion)
    return SECONDS if time is None else screen_time(float(np.ptp(time)))


def motion_data(motion: Motion, home: Mapping[str, float]) -> Data:
    """Coordinates of all samples, and how far each driver goes."""
    # Runs of samples without an answer, from the first to the last.
    bad = np.zeros(motion.result.n + 2, int)
    bad[[k + 1 for k in motion.quality.gaps]] = 1
    m, gaps, time = (
        motion.mechanism,
        [[int(a), int(b) - 1] for a, b in np.flatnonzero(np.diff(bad)).reshape(-1, 2)],
        simulated_time(motion),
    )
    pose = {d: float(q[motion.clearest]) for d, q in motion.q.items()}
    return {
        "n": len(motion.samples),
        "q": {driver: q.tolist() for driver, q in motion.q.items()},
        "home": dict(home),
        "travel": {d: travel(m, d, pose) for d in m.drivers} if time is None else {},
        "units": {d: m.structure.driver_joint(d).coordinate_unit for d in m.drivers},
        "time": None if time is None else time.tolist(),
        "seconds": seconds_of(motion),
        "forward": time is not None or motion.returns,
        "gaps": gaps,
        "why": None if time is None or not gaps else fault_of(motion),  # of a turn when asked for
    }


def poses_of(motion: Motion) -> dict[str, list[list[float | None]]]:
    """x, y and angle of each link at all samples, for mechanisms without a function for them."""
    names = motion.mechanism.names
    if names is None:
        frames = {str(link): (o, motion.axis[link]) for link, o in motion.origin.items()}
    else:
        frames = {
            name: (
                motion.at(at.link, marker_place(motion.structure, at.marker)),
                motion.axis[at.link] * np.exp(1j * at.turn),
            )
            for name, at in names.links.items()
        }
    return {
        name: [numbers(x) for x in (o.real, o.imag, np.angle(e))] for name, (o, e) in frames.items()
    }


def numbers(x: Array) -> list[float | None]:
    """Numbers as JSON has them: none for what is not there."""
    return [v if math.isfinite(v) else None for v in np.asarray(x, float).tolist()]
