"""One sample by blockmech and by the independent judge, compared output by output.

Errors are in units of the condition of the judge's Jacobian. A motion counts by the largest of
its kind, where a rate counts as the speed that it gives at the mechanism's size; a force, a
friction or an effort counts by its own size.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from tests.independent import multibody as mb

NOISE = 1e-15  # of the largest force: below it a force is the rounding of others


class Verdict(NamedTuple):
    """The judge's poses, rates, accelerations (3,) by link, forces, condition and size [m]."""

    poses: Mapping[str, Any]
    rates: Mapping[str, Any]
    accelerations: Mapping[str, Any]
    forces: mb.Reactions
    condition: float
    size: float


def verdict(system: mb.System, poses: Any, qd: Any, qdd: Any, friction: bool) -> Verdict:
    """Everything at closed poses (n, 3) with driver rates and accelerations (d,)."""
    system = wound(system, poses)
    rates = mb.rates(system, poses, qd)
    accelerations = mb.accelerations(system, poses, rates, qdd)
    forces = mb.reactions(system, poses, rates, accelerations, friction=friction)
    rows = (dict(zip(system.links, x, strict=True)) for x in (poses, rates, accelerations))
    size = float(mb.Instant(system, poses).size)
    return Verdict(*rows, forces, mb.conditioning(system, poses), size)


def wound(system: mb.System, poses: Any) -> mb.System:
    """The system with torsion springs wound by whole turns: blockmech counts none."""
    loads, instant, turn = dict(system.loads), mb.Instant(system, poses), 2 * np.pi
    for name, load in loads.items():
        if isinstance(load, mb.TorsionSpring) and (
            load.joint is None or system.joints[load.joint].type == "R"
        ):
            angle = float(instant.coordinate(load).value) - load.rest_angle
            rest = load.rest_angle + turn * np.ceil(angle / turn - 0.5)
            loads[name] = replace(load, rest_angle=rest)
    return replace(system, loads=loads)


def motion(run: Any, judge: Verdict, link: str = "") -> Iterator[tuple[str, float]]:
    """Errors of places, velocities and accelerations, by output; ``link`` heads their names."""
    kinds = ("p", "angle", judge.poses), ("v", "omega", judge.rates)
    for vector, scalar, rows in (*kinds, ("a", "alpha", judge.accelerations)):
        expected = {name: [float(x) for x in row] for name, row in rows.items()}
        largest = max(max(np.hypot(x, y), judge.size * abs(w)) for x, y, w in expected.values())
        for name, (x, y, turn) in expected.items():
            off = abs(run[f"{link}{name}.{vector}"][0] - complex(x, y))
            yield f"{name}.{vector}", relative(off, largest, judge)
            off = run[f"{link}{name}.{scalar}"][0] - turn
            if scalar == "angle":
                off = np.angle(np.exp(1j * off))
            yield f"{name}.{scalar}", relative(abs(off), largest / judge.size, judge)


def forces(
    run: Any, judge: Verdict, joint: str = "", driver: str = ""
) -> Iterator[tuple[str, float]]:
    """Errors of reactions, guide couples, friction and efforts, by output."""
    joints = judge.forces.joints
    top = max((np.hypot(*map(float, j.force)) for j in joints.values()), default=0.0)

    def own(found: Any, wanted: Any, size: float = 0.0, noise: float = top) -> float:
        off = max(abs(complex(found) - complex(wanted)) - NOISE * noise, 0.0)
        return relative(off, max(abs(complex(wanted)), size), judge)

    for name, there in joints.items():
        at = f"{joint}{name}"
        yield name, own(run[f"{at}.reaction"][0], complex(*map(float, there.force)))
        if there.C is not None:
            size = abs(float(there.C)) + judge.size * abs(float(there.N))
            yield f"{name}.C", own(run[f"{at}.C"][0], there.C, size, top * judge.size)
        if f"{at}.friction" in run:
            noise = top if there.C is not None else top * judge.size
            yield f"{name}.friction", own(run[f"{at}.friction"][0], there.friction, noise=noise)
    for name, effort in judge.forces.drivers.items():
        noise = top * max(1.0, judge.size)
        yield f"{name}.drive", own(run[f"{driver}{name}.drive"][0], effort, noise=noise)


def relative(error: float, scale: float, judge: Verdict) -> float:
    """Error per scale and condition; what is exact is so at any scale."""
    return float(error / scale / judge.condition) if error else 0.0
