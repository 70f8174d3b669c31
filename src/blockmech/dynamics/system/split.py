"""What the loads of a scene depend on, read from the elements' own declarations.

The reduced effort is split as  tau(q) - damping(q) q' + rate_load(q, q', t): loads that
are straight lines in a rate (dampers, DC motors) are damping; the rest of what follows
a rate or the time is ``rate_load``, without any kernel where it acts on the driver itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from blockmech.dynamics.chebyshev import Floats
from blockmech.dynamics.system.reduced import TURN, Depends
from blockmech.engines import NumpyEngine, ScalarEngine
from blockmech.loads.contract import VELOCITY_READS, Element, Following
from blockmech.loads.force import Force
from blockmech.loads.laws import DC, Fourier, Polynomial, Table
from blockmech.loads.motor import Motor
from blockmech.loads.spring import Spring
from blockmech.loads.torsion_spring import TorsionSpring
from blockmech.model.structure import JointRef, Structure
from blockmech.passes.following import followed, path_of
from blockmech.passes.forces import negated
from blockmech.passes.forward import ZERO, link_velocity, marker_velocity
from blockmech.passes.loads import NOTHING, cm_velocity, law_at, terminal_term, weight_on
from blockmech.plan import Friction, Schedule
from blockmech.plane import hyp
from blockmech.typing import Complex, Real

RATE_READS = frozenset({*VELOCITY_READS, "qd"})
MOVING = frozenset({"rate", "time"})  # arguments of laws that are not of the position
SAME = 1e-12  # relative distance within which two periods fit into one another
FREE = Friction("none")


def depends_on(structure: Structure) -> Depends:
    """What the loads depend on: "q" always, "rate" and "time" where declared."""
    found = {"q"}
    for element in structure.elements.values():
        found |= element_depends(element)
    return frozenset(found)


def element_depends(element: Element) -> set[str]:
    """Of {"rate", "time"}: what one element depends on besides the position."""
    found = set()
    for reads in element.reads().values():
        found |= {"rate"} if RATE_READS & set(reads) else set()
        found |= {"time"} if "t" in reads else set()
    return found


def straight(element: Element) -> bool:
    """Whether an element is a straight line in the rate and free of the time."""
    if not isinstance(element, Following):
        return True  # springs with dampers
    law = element.law
    if law.variables() == ("rate",):
        return isinstance(law, DC) or (isinstance(law, Polynomial) and len(law.coefficients) <= 2)
    return not MOVING & set(law.variables())


def lossless(structure: Structure) -> bool:
    """Whether every load has a potential that is the same in the same pose.

    Weights have; springs, and forces that stay as they are in ground axes.
    """
    return all(
        (isinstance(e, Spring | TorsionSpring) and not e.damping)
        or (isinstance(e, Force) and e.axes == "ground")
        for e in structure.elements.values()
    )


@dataclass(frozen=True)
class OwnLoads:
    """Loads of rate or time on the driver itself, which need no kernel of the mechanism.

    ``batch`` (q' (n,), t) -> (n,), ``one`` (q', t) -> float: the effort less that at rest
    and time 0.
    """

    batch: Callable[[Floats, float], Floats]
    one: Callable[[float, float], float]


def own_loads(structure: Structure, scene: Any, driver: str) -> OwnLoads | None:
    """Crooked loads, if there are any and all of them act on the driver; else None."""
    crooked = [n for n, e in structure.elements.items() if not straight(e)]
    signs = [_way(structure, name, driver) for name in crooked]
    if not crooked or not all(signs):
        return None
    s = Schedule(structure, scene, FREE)
    rate = s.input("qd", driver)
    backward = s.emit(negated, rate, name="backward")
    clock = s.time()
    terms = []
    for name, way in zip(crooked, signs, strict=True):
        element = structure.elements[name]
        assert isinstance(element, Following)
        own = backward if element.driver is None and way < 0 else rate
        given = [clock if what == "time" else own for what in element.law.variables()]
        term = law_at(s, name, given)
        terms.append(term if way > 0 else s.emit(negated, term, name=f"{name}_back"))
    program = s.program([s.sum(terms, "own")])
    many, single = NumpyEngine(program), ScalarEngine(program)
    still = float(single.one([0.0, 0.0])[0])

    def batch(qd: Floats, t: float) -> Floats:
        given = {"qd_0": qd, "t": np.full(qd.shape, t)}
        return np.asarray(many.run(given, qd.size)[0] - still)

    def one(qd: float, t: float) -> float:
        return float(single.one([qd, t])[0]) - still

    return OwnLoads(batch, one)


def _way(structure: Structure, name: str, driver: str) -> int:
    """+1 or -1 where an element is a motor from frame to driver or back; else 0."""
    element = structure.elements[name]
    if not isinstance(element, Motor) or not set(element.law.variables()) <= MOVING:
        return 0
    ref = structure.driven[driver]
    crank = structure.later_link(ref)
    if structure.earlier_link(ref) != structure.frame_link:
        return 0
    a, b = (structure.holds[JointRef(name, terminal)].on for terminal in ("a", "b"))
    sign = structure.coordinate(driver).sign
    if (a, b) == (structure.frame_link, crank):
        return sign
    return -sign if (a, b) == (crank, structure.frame_link) else 0


# -- period ------------------------------------------------------------------------------


def period_of(structure: Structure, driver: str, rotary: bool) -> float | None:
    """Period [rad] of everything that depends on the coordinate; None if there is none."""
    if not rotary or not all(path_of(structure, n).repeats for n in followed(structure)):
        return None
    turns = 1
    for element in structure.elements.values():
        if not (isinstance(element, Following) and element.driver == driver):
            continue
        if "coordinate" not in element.law.variables():
            continue
        law = element.law
        if isinstance(law, Fourier) and law.period is None:
            more = law.turns or 1
        elif isinstance(law, Table | Fourier) and law.whole:
            more = _turns(law.whole)
        else:
            return None
        if not more:
            return None
        turns = math.lcm(turns, more)
    return TURN * turns


def _turns(period: float) -> int:
    """Whole turns [-] after which a period fits; 0 if it never does."""
    ratio = period / TURN
    if ratio >= 0.5:
        return round(ratio) if abs(ratio - round(ratio)) <= SAME * ratio else 0
    return 1 if abs(1 / ratio - round(1 / ratio)) <= SAME / ratio else 0


# -- size of the loads -------------------------------------------------------------------


def work_at_most(F: Complex, v: Complex) -> Real:
    """|F| |v|: what a force can give per unit driver rate, whatever its direction."""
    return hyp(F) * hyp(v)


def turn_at_most(M: Real, om: Real) -> Real:
    """|M om|"""
    return abs(M * om)


def load_size(structure: Structure, scene: Any, driver: str) -> Callable[[float], float]:
    """q -> sum of the magnitudes of the contributions to tau, at rest and time 0."""
    s = Schedule(structure, scene, FREE)
    terms = []
    for link in structure.links:
        force = s.ask(weight_on, link) if link != structure.frame_link else NOTHING
        v = s.ask(cm_velocity, link, driver) if force else ZERO
        if v != ZERO:
            terms.append(s.emit(work_at_most, force.forces[0], v, name=f"{link}_size"))
    for name, element in structure.elements.items():
        for terminal, declared in element.terminals.items():
            ref = JointRef(name, terminal)
            marker = structure.holds[ref]
            load = s.ask(terminal_term, ref)
            if declared.kind == "point":
                v = s.ask(marker_velocity, marker, driver)
                if v != ZERO:
                    terms.append(s.emit(work_at_most, load, v, name=f"{ref}_size"))
                continue
            om = s.ask(link_velocity, marker.on, driver).scalar
            if om != "0.0":
                terms.append(s.emit(turn_at_most, load, om, name=f"{ref}_size"))
    program = s.program([s.sum(terms, "size") if terms else "0.0"])
    engine = ScalarEngine(program)
    order = program.inputs

    def size(q: float) -> float:
        given = {"q_0": q}
        return float(engine.one([given.get(name, 0.0) for name in order])[0])

    return size
