"""What a trade recommends, run afresh, against answers that are not blockmech's own way.

Sweeps are judged by the tests' multibody solver, free motions by `tests/analysis/outside.py`. A
few graphs stand for all in the suite; ``BLOCKMECH_CAMPAIGN=1`` takes every graph of the gallery
(some minutes).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import blockmech as bm
from blockmech.analysis.trade import Trade, trade
from tests.analysis import outside
from tests.blocks.twin import Twin
from tests.dynamics import machines
from tests.independent import multibody as mb

WHOLE = os.environ.get("BLOCKMECH_CAMPAIGN", "0") != "0"
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
BUDGET = 30.0 if WHOLE else 4.0  # [s] of a trade
SHORT = 2.0  # [s] of a trade of some outputs
WANTS = ("*.drive", "*.reaction", "*.p")
POSES = 12 if WHOLE else 4  # samples that the multibody solver judges
SAMPLES = 721
NEAR = 1e-2  # margin that judged samples have, or else more of it than most
ROUNDING = 1e-9  # of the largest number of its unit: a smaller output is rounding alone
KINDS = ("real", "vector")

NAMES = sorted(p.stem for p in outside.GRAPHS.glob("*.json"))
DRIVEN = [n for n in NAMES if outside.mechanism(n).scene.drive]
SOME_DRIVEN = ("ruiz_fourbar", "pump", "engine", "whitworth_shaper", "oldham_coupling")
SOME_MOVING = ("scotch_yoke", "watt_sixbar", "pump", "fivebar_falling")


def some(names: Any, few: tuple[str, ...]) -> list[str]:
    """All names in the campaign, a few of them in the suite."""
    return [n for n in names if WHOLE or n in few]


# -- sweeps ----------------------------------------------------------------------------------


class WithMachines(Twin):
    """A twin that knows a thrust by the crank's angle and a motor by its rate."""

    def at(self, q: float, qd: float) -> WithMachines:
        self.q, self.qd = q, qd
        loads = {n: self._load(n, e) for n, e in self.structure.elements.items()}
        self.system = mb.System(
            self.system.links, self.system.joints, self.system.drivers, loads, self.system.gravity
        )
        return self

    def _load(self, name: str, element: Any) -> Any:
        if isinstance(element, bm.Thrust):
            angles = [*machines.GAS_ANGLES, 2 * machines.TURN]
            forces = [*machines.GAS_FORCES, machines.GAS_FORCES[0]]
            spline = CubicSpline(angles, forces, bc_type="periodic")
            push = -float(spline(getattr(self, "q", 0.0) % (2 * machines.TURN)))
            return mb.Force("piston.j", (0.0, 0.0), (push, 0.0))
        if isinstance(element, bm.Motor):
            stall, free = machines.MOTOR
            return mb.Couple("crank.crank", stall * (1 - getattr(self, "qd", 0.0) / free))
        return super()._load(name, element)


@cache
def swept(name: str) -> Trade:
    return trade(outside.mechanism(name), want="*", budget=BUDGET, samples=SAMPLES)


@cache
def exact(name: str) -> tuple[tuple[int, ...], dict[str, Any], dict[str, float]]:
    """Samples, output -> values there by the multibody solver, and its largest magnitude.

    Samples are spread over the sweep and stay away from special poses; outputs that are
    nothing but rounding are left out.
    """
    mech = outside.mechanism(name)
    run = mech.run(samples=SAMPLES, on_gap="mark")
    margins = [run[n] for n in run if n.endswith(".margin")] or [np.ones(SAMPLES)]
    least = np.min(margins, axis=0)
    enough = min(NEAR, float(np.nanmedian(least)))
    special = {f.sample for f in run.quality.flags}
    plain = [
        i
        for i in range(SAMPLES)
        if run.quality.status[i] == "ok" and i not in special and least[i] >= enough
    ]
    picked = [plain[round(k * (len(plain) - 1) / (POSES - 1))] for k in range(POSES)]
    twin = WithMachines(mech)
    columns: dict[str, list[Any]] = {}
    for i in picked:
        q, qd, qdd = (
            [run[f"{d}.{x}"][i] for d in mech.drivers] for x in ("q", "rate", "acceleration")
        )
        found = twin.at(q[0], qd[0]).judge(q, qd, qdd)
        for output, value in told(found):
            columns.setdefault(output, []).append(value)
    size = {n: float(np.nanmax(np.abs(run[n]))) for n in run if run.output(n).kind in KINDS}
    turn = max(size[n] for n in size if run.unit(n) == "rad/s")
    natural = {"rad/s2": turn**2, "m/s2": turn * max(size[n] for n in size if n.endswith(".v"))}
    scale = {}
    for output in columns:
        unit = run.unit(output)
        largest = max(max(size[n] for n in size if run.unit(n) == unit), natural.get(unit, 0.0))
        if size[output] > ROUNDING * largest:
            scale[output] = 1.0 if unit == "rad" else size[output]
    return tuple(picked), {n: np.array(columns[n]) for n in scale}, scale


def told(verdict: Any) -> Any:
    """What the multibody solver says, by blockmech's names of outputs."""
    for link, pose in verdict.poses.items():
        yield f"{link}.p", pose[0] + 1j * pose[1]
        yield f"{link}.angle", pose[2]
        v, a = verdict.rates[link], verdict.accelerations[link]
        yield f"{link}.v", v[0] + 1j * v[1]
        yield f"{link}.omega", v[2]
        yield f"{link}.a", a[0] + 1j * a[1]
        yield f"{link}.alpha", a[2]
    for name, joint in verdict.forces.joints.items():
        yield f"{name}.reaction", joint.force[0] + 1j * joint.force[1]
        yield f"{name}.friction", joint.friction
        if joint.C is not None:
            yield f"{name}.C", joint.C
    for name, effort in verdict.forces.drivers.items():
        yield f"{name}.drive", effort


def error_of_sweep(name: str, run: bm.result.Result) -> float:
    """Largest error at the judged samples, relative to each output's largest magnitude."""
    picked, values, scale = exact(name)
    worst = 0.0
    for output in values.keys() & set(run):
        wanted = values[output]
        gap = run[output][list(picked)] - wanted
        if output.endswith(".angle"):  # known up to whole turns
            gap = (gap + np.pi) % (2 * np.pi) - np.pi
        worst = max(worst, float(np.abs(gap).max()) / scale[output])
    return worst


def recommended(found: Trade) -> Iterator[tuple[float, Any]]:
    """Each target with the setting recommended for it, which is on the front."""
    for target in TARGETS:
        best = found.best(target)
        if best is None:
            assert said_no(found, target)
            continue
        assert best in found.pareto
        yield target, best


@pytest.mark.parametrize("name", some(DRIVEN, SOME_DRIVEN))
def test_a_sweep_as_recommended_is_as_exact_as_the_multibody_solver_demands(name: str) -> None:
    found, mech = swept(name), outside.mechanism(name)
    for target, best in recommended(found):
        fresh = mech.run(samples=SAMPLES, on_gap="mark", **best.options)
        assert error_of_sweep(name, fresh) <= target


@pytest.mark.parametrize("want", WANTS)
@pytest.mark.parametrize("name", some(DRIVEN, ("ruiz_fourbar", "excavator")))
def test_a_sweep_of_some_outputs_is_as_exact_as_recommended_and_as_estimated(
    name: str, want: str
) -> None:
    mech = outside.mechanism(name)
    found = trade(mech, want=want, budget=SHORT, samples=SAMPLES)
    for target in TARGETS:
        run = mech.run(samples=SAMPLES, want=want, accuracy=target, on_gap="mark")
        assert run.accuracy is not None
        assert error_of_sweep(name, run) <= run.accuracy.estimate
        best = found.best(target)
        if best is None:
            assert said_no(found, target)
            continue
        fresh = mech.run(samples=SAMPLES, want=want, on_gap="mark", **best.options)
        assert error_of_sweep(name, fresh) <= target


@pytest.mark.parametrize("name", some(DRIVEN, SOME_DRIVEN))
@pytest.mark.parametrize("target", TARGETS)
def test_a_run_is_as_exact_as_it_estimates(name: str, target: float) -> None:
    run = outside.mechanism(name).run(samples=SAMPLES, accuracy=target, on_gap="mark")
    assert run.accuracy is not None
    assert error_of_sweep(name, run) <= run.accuracy.estimate
    assert run.accuracy.estimate <= target or "accuracy not reached" in str(run.accuracy)


def said_no(found: Trade, target: float) -> bool:
    """Whether the trade says that the target is out of reach, or out of proof."""
    words = replace(found, target=target).recommendation
    if not found.points:
        return "no setting was measured" in words and "budget" in words
    return f"{target:.0e}".replace("e-0", "e-") in words and (
        "cannot be confirmed" in words or "no setting here gives" in words
    )


# -- free motions ----------------------------------------------------------------------------


@cache
def moved(name: str) -> Trade:
    mech, moving = outside.mechanism(name), outside.MOTIONS[name]
    asked = moving.request | waived(name)
    return trade(mech, "simulate", budget=BUDGET, start=outside.start(name), **asked)


def waived(name: str) -> dict[str, str]:
    """Joint friction is left out of motions."""
    return {"friction": "none"} if outside.mechanism(name).frictional_joints else {}


@pytest.mark.parametrize("name", some(outside.MOTIONS, SOME_MOVING))
def test_a_simulation_as_recommended_is_as_exact_as_another_method_demands(name: str) -> None:
    found, mech, moving = moved(name), outside.mechanism(name), outside.MOTIONS[name]
    for target, best in recommended(found):
        asked = moving.request | waived(name) | dict(best.options)
        fresh = mech.simulate(start=outside.start(name), **asked)
        assert outside.error_of_all(name, fresh) <= target + outside.judged(name).doubt


@pytest.mark.parametrize("name", some(outside.MOTIONS, SOME_MOVING))
@pytest.mark.parametrize("target", TARGETS)
def test_a_simulation_is_as_exact_as_it_estimates(name: str, target: float) -> None:
    mech, moving = outside.mechanism(name), outside.MOTIONS[name]
    asked = moving.request | waived(name)
    run = mech.simulate(start=outside.start(name), accuracy=target, **asked)
    assert run.motion is not None
    assert outside.error(name, run) <= run.motion.error + outside.judged(name).doubt
    notes = " ".join(run.motion.notes)
    assert run.motion.error <= target or "accuracy not reached" in notes


def massless(name: str) -> bool:
    structure = outside.mechanism(name).structure
    return not any(structure.properties(link).massive for link in structure.links)


MASSLESS = [n for n in NAMES if massless(n)]


@pytest.mark.parametrize("name", MASSLESS)
def test_what_has_no_inertia_is_not_simulated_and_says_so(name: str) -> None:
    mech = outside.mechanism(name)
    start = dict.fromkeys(mech.drivers, (0.4, 1.0))
    with pytest.raises(bm.RequestError, match="no link has mass or inertia"):
        trade(mech, "simulate", until="time=1", start=start)


def test_every_graph_with_inertia_has_its_motion_here() -> None:
    assert set(outside.MOTIONS) == set(NAMES) - set(MASSLESS)
