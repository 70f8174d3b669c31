"""Five hundred random mechanisms against a solver that shares nothing with blockmech.

All dyads, both drivers, guides on moving links, multiple pins, springs, loads, friction,
margins down to 1e-3. Each failure prints the seed; the case is a graph file.
"""

from __future__ import annotations

import functools
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import pytest

from blockmech.model.graph import Graph
from blockmech.result import Result
from blockmech.testing.strategies import Case, Options, Seeded, random_mechanism
from tests.blocks.twin import Twin
from tests.independent import multibody as mb

SEEDS = range(500)
OPTIONS = Options(groups=(1, 5), drivers=(1, 2), least_margin=1e-3)
MOTION, FORCES = 1e-12, 1e-11  # of the largest of their kind, times the conditioning


@dataclass
class Errors:
    """Relative errors of a case, each over the judge's conditioning [-]."""

    worst: dict[str, float] = field(default_factory=dict)

    def add(
        self,
        kind: str,
        ours: list[complex],
        theirs: list[complex],
        condition: float,
        least: float = 0.0,
    ) -> float:
        """Add a kind of output; its scale is the largest of the kind, but at least ``least``.

        A rate counts as the speed that it gives at the mechanism's size, a guide couple as
        the force that it gives there: where nothing turns, turning has no size of its own.
        """
        a, b = np.array(ours), np.array(theirs)
        scale = max(float(np.abs(b).max(initial=0.0)), least)
        error = np.abs(a - b).max(initial=0.0)
        if scale > 0:
            self.worst[kind] = float(error / (scale * condition))
        return scale


@functools.cache
def case(seed: int) -> Case:
    return random_mechanism(Seeded(seed), OPTIONS)


@functools.cache
def compared(seed: int, friction: bool) -> tuple[Errors, str]:
    """Errors of a case, and how its friction was settled by either solver."""
    made = case(seed)
    mechanism = made.graph.compile()
    drivers = mechanism.drivers
    request = made.request
    method = "newton" if friction else "none"
    run = mechanism.run(**request, friction=method, on_gap="mark")
    states = [[request[what][d] for d in drivers] for what in ("at", "rates", "accelerations")]
    twin = Twin(_without_idle_friction(made, run).compile())
    verdict = twin.judge(*states, friction=friction)
    size = float(mb.Instant(twin.system, np.array(list(verdict.poses.values()))).size)
    errors = Errors()
    status = run.quality.status[0]
    if status != "ok" or not verdict.forces.converged:
        return errors, f"{status}, judge {'solved' if verdict.forces.converged else 'not'}"
    links = [k for k in mechanism.structure.links if k != mechanism.structure.frame_link]
    c = verdict.condition

    def motion(vector: str, scalar: str, rows: dict[str, np.ndarray]) -> None:
        row = [rows[str(k)] for k in links]
        places = [complex(*x[:2]) for x in row]
        reach = errors.add(vector, [run[f"{k}.{vector}"][0] for k in links], places, c)
        ours = [run[f"{k}.{scalar}"][0] for k in links]
        turns = [float(x[2]) for x in row]
        if scalar == "angle":
            ours, turns = np.exp(1j * np.array(ours)), np.exp(1j * np.array(turns))
        errors.add(scalar, ours, turns, c, reach / size)

    motion("p", "angle", verdict.poses)
    motion("v", "omega", verdict.rates)
    motion("a", "alpha", verdict.accelerations)
    joints = verdict.forces.joints
    forces = [complex(*map(float, j.force)) for j in joints.values()]
    top = errors.add("reaction", [run[f"{n}.reaction"][0] for n in joints], forces, c)
    guides = [n for n, j in joints.items() if j.C is not None]
    couples = [float(joints[n].C) for n in guides]
    errors.add("C", [run[f"{n}.C"][0] for n in guides], couples, c, top * size)
    rubbing = [float(j.friction) for j in joints.values()]
    errors.add("friction", [run[f"{n}.friction"][0] for n in joints], rubbing, c)
    efforts = [complex(verdict.forces.drivers[d]) for d in drivers]
    errors.add("drive", [complex(run[f"{d}.drive"][0]) for d in drivers], efforts, c)
    return errors, "ok"


def _without_idle_friction(made: Case, run: Result) -> Graph:
    """The case for the judge: friction of structural zeros would be noise over noise to it."""
    graph = Graph(made.graph.name)
    graph.scene, graph.wires = made.graph.scene, made.graph.wires
    for name, block in made.graph.blocks.items():
        joints = [f"{name}.{j}.reaction" for j in getattr(block, "joints", {})]
        idle = bool(joints) and not any(run[j][0] for j in joints)
        graph.add(name, block.model_copy(update={"friction": {}}) if idle else block)
    return graph


def test_cases_are_as_varied_as_they_should_be() -> None:
    kinds, margins, links = Counter(), [], []
    for seed in SEEDS:
        mechanism = case(seed).graph.compile()
        kinds.update(b.type_name for b in mechanism.structure.blocks.values())
        links.append(len(mechanism.structure.links) - 1)
        run = mechanism.run(**case(seed).request, want=["*.margin"], on_gap="mark")
        margins += [float(run[name][0]) for name in run]
    counts = np.histogram(np.log10(margins), bins=[-4, -3, -2, -1, 0.01])[0]
    print(dict(kinds), "links", min(links), max(links), "margins 1e-4..1:", counts)
    assert all(kinds[f"dyad.{k}"] >= 50 for k in ("rrr", "rrp", "rpr", "prp", "rpp"))
    assert max(links) >= 12
    assert min(margins) < 3e-3


@pytest.mark.parametrize("friction", [False, True], ids=["frictionless", "friction"])
def test_motion_and_forces_are_the_judges(friction: bool) -> None:
    outcomes: Counter[str] = Counter()
    worst: dict[str, float] = {}
    for seed in SEEDS:
        errors, outcome = compared(seed, friction)
        outcomes[outcome] += 1
        for kind, error in errors.worst.items():
            allowed = MOTION if kind in ("p", "angle", "v", "omega", "a", "alpha") else FORCES
            assert error <= allowed, f"seed {seed}: {kind} off by {error:.2g}\n{case(seed)!r}"
            worst[kind] = max(worst.get(kind, 0.0), error)
    print(dict(outcomes), {k: f"{v:.1e}" for k, v in worst.items()})
    assert outcomes["ok"] >= 0.9 * len(SEEDS)
    # Both solvers agree on which cases have no friction solution.
    assert set(outcomes) <= {"ok", "self-locked, judge not", "jammed, judge not"}
