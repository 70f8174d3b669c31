"""The programs of joint friction in motion: the force pass with friction as input, and the laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from blockmech.dynamics.friction import PairProgram
from blockmech.dynamics.source import Source, margins
from blockmech.engines.llvm import SingleEvaluator
from blockmech.engines.numpy import NumpyEngine
from blockmech.friction.laws.contract import FrictionLaw, FrictionTerms
from blockmech.model.structure import JointRef
from blockmech.passes import forces, forward, friction, pairs, signals
from blockmech.passes.homotopy import schedule
from blockmech.plan.plan import Friction, Schedule
from blockmech.plan.values import Value

GIVEN = Friction(friction.GIVEN)


def pair_program(compiled: Source, pushed: tuple[JointRef, ...] = ()) -> PairProgram | None:
    """The force pass of a mechanism with its friction laws; None where none can act.

    ``pushed`` : pairs along whose coordinates stops may push
    """
    structure = compiled.structure
    friction_method = replace(GIVEN, pushed=pushed)  # a push loads pairs that nothing else does
    s = schedule(structure, compiled.scene, friction_method)
    joints = s.ask(friction.input_joints)
    if not joints:
        return None
    values = [s.ask(forces.drive, driver) for driver in structure.drivers]
    for ref in joints:
        pair = s.ask(forces.reaction, ref)
        assert pair is not None  # such a block is active
        values.append(pairs.statics(s, ref).measure(s, ref, pair))
    values += [s.ask(forward.slip, ref) for ref in joints]
    rise = [s.ask(forward.slip_acceleration, ref) for ref in joints]
    program = s.program([*values, *rise, *margins(s)])
    apart = schedule(structure, compiled.scene, friction_method)
    rules = friction.terms, friction.terms_at_rest
    law_terms = [x for rule in rules for x in terms(apart, joints, rule)]
    laws = [structure.friction_law(ref) for ref in joints]
    rates = [*signals.rates(s), *friction.deflection_rates(s), *signals.kinks(s)]
    return PairProgram(
        tuple(map(structure.pair_name, joints)),
        tuple(pairs.statics(s, ref).edges for ref in joints),
        program,
        apart.program(law_terms),
        s.program([*values, *margins(s), *rates, *terms(s, joints, friction.terms)]),
        tuple(law.remembers for law in laws),
        tuple(map(structure.separates, joints)),
        steepest(laws),
        any(law.drags for law in laws),
        NumpyEngine(program),
        SingleEvaluator(program),
    )


def steepest(laws: Sequence[FrictionLaw]) -> tuple[float, ...]:
    """Largest slopes of friction over the load where a law is not linear in it; 0 of the others."""
    if not any(law.reads_load for law in laws):
        return ()
    return tuple(float(law.parameters().steepest) if law.reads_load else 0.0 for law in laws)


def terms(s: Schedule, joints: Sequence[JointRef], rule: Callable[..., Value]) -> list[Value]:
    """Factors (m,) and drags (m,) of pairs by a rule that asks their laws."""
    laws = [s.ask(rule, ref) for ref in joints]
    return [getattr(law, part) for part in FrictionTerms._fields for law in laws]
