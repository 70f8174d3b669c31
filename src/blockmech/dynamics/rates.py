r"""The right-hand side of one driver as machine code: what `equation` says, a state or a step.

A row of numbers tells of a state (q, q', W), with joint friction (q, q', W, F):

    the rates of the state, margin, J, real and imaginary part of the load on each pair, and what
    is watched: margin and J above the least that counts (J in usual ones), slips of the pairs,
    sides of guides, kinks of signals, q'

Given are 0, 1 (states of the force pass are made of them; nothing is folded), the least J and the
directions of slip. The text is made of the programs that are interpreted otherwise, so both
say the same to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from blockmech.engines.binding import bind_functions
from blockmech.engines.compiled_rates import CompiledRhs
from blockmech.engines.nodes import Untraceable
from blockmech.engines.stages import Method
from blockmech.engines.trace import PRIMITIVES
from blockmech.friction.equations import loads
from blockmech.friction.solvers import Solution, balanced
from blockmech.ground.errors import MissingEngineError
from blockmech.ground.plane import NAN, minimum, mul, where
from blockmech.ground.tolerances import BLUR as LEAST_MARGIN
from blockmech.typing import Complex, Data, Edges, Planars, Real, Reals

if TYPE_CHECKING:
    from blockmech.dynamics.friction import PairFriction
    from blockmech.dynamics.programs import SignalProgram
    from blockmech.plan.plan import Program

LEAST_INERTIA = 1e-9  # [-] of a typical one: beyond it the speed goes without bound
NEAR = 0.1  # margin, a transmission angle of 18 degrees, below which a dip within a step counts


def bearing(load: Complex) -> tuple[Real, Real]:
    """Of a load N + 2i C/L on a guide the larger part, and what the first is larger by.

    Friction has kinks where either changes its sign.
    """
    N, C = load.real, load.imag
    return where(abs(N) >= abs(C), N, C), abs(N) - abs(C)


def signed_terms(sides: Reals, law: Reals, drags: bool) -> tuple[Reals, Reals]:
    """Signed factors and drags (m,) of pairs that slip in some directions; no drags of none."""
    against = [-side * x for side, x in zip((*sides, *sides), law, strict=True)]
    return tuple(against[: len(sides)]), tuple(against[len(sides) :]) if drags else ()


class FrictionSolution(NamedTuple):
    """What friction does.

    slips : (m,) relative rates of the pairs per unit rate of the driver
    effort : [N m or N] that friction takes
    loads : (m,) on the pairs
    """

    qdd: Real
    slips: Reals
    effort: Real
    loads: Planars


def resistance(
    rows: Sequence[Planars],
    laws: Callable[..., tuple[Reals, Reals]],
    steepest: Reals,
    guides: Edges,
    balance: Callable[..., Solution],
) -> FrictionSolution:
    """Friction from the program's values, with laws and their slopes as of `solvers.balanced`.

    ``rows`` are those of the loads at the rate, of a unit of q'', of a unit of each friction;
    ``balance`` is that function with a solver.
    """
    m = len(guides)
    J, push = rows[1][0], -rows[0][0]
    s = [-row[0] for row in rows[2:]]
    a0 = push / J
    base = tuple(rows[0][1 + j] + mul(rows[1][1 + j], a0) for j in range(m))
    matrix = tuple(
        tuple(rows[2 + i][1 + j] + mul(rows[1][1 + j], s[i] / J) for i in range(m))
        for j in range(m)
    )
    solution = balance(laws, steepest, guides, base, matrix)
    effort = 0.0 * J
    for x, t in zip(s, solution.t, strict=True):
        effort = effort - x * t
    return FrictionSolution((push - effort) / J, s, effort, loads(solution.t, base, matrix))


def free(
    values: Reals, qd: Real, zero: Real, inertia_limit: Real, states: int, kinks: int
) -> tuple[Real, ...]:
    """The row of a state without friction, from J, tau, dJ/dq, signals and the margins."""
    J, tau, dJ, *rest = values
    margin, state_rates = _smallest(rest[states + kinks :], zero), rest[:states]
    rates = _rates(margin, J, qd, (tau - 0.5 * dJ * qd * qd) / J, tau * qd, *state_rates)
    return (*rates, *_watched(margin, J, inertia_limit), *rest[states : states + kinks], qd)


def _watched(margin: Real, J: Real, inertia_limit: Real) -> tuple[Real, ...]:
    return margin - LEAST_MARGIN, J / inertia_limit * LEAST_INERTIA - LEAST_INERTIA


def _rates(margin: Real, J: Real, qd: Real, qdd: Real, *powers: Real) -> tuple[Real, ...]:
    """Rates of the state, margin and J; no rates where there is no pose."""
    possible = margin > 0.0
    rates = (qd, where(J > 0.0, qdd, NAN), *powers)
    return (*(where(possible, x, NAN) for x in rates), margin, J)


def _smallest(margins: Reals, zero: Real) -> Real:
    smallest = zero + 1.0
    for m in margins:
        smallest = minimum(smallest, m)
    return smallest


def rubbing(
    rows: Sequence[Planars],
    inert: Planars,
    solved: FrictionSolution,
    guides: Edges,
    separates: Sequence[bool],
    qd: Real,
    zero: Real,
    inertia_limit: Real,
    states: Reals,
    kinks: Reals,
) -> tuple[Real, ...]:
    """The row of a state with friction, from rows of the force pass and what friction does.

    ``inert`` is the row at the same rate without loads.
    """
    m = len(solved.slips)
    tau, J = inert[0] - rows[0][0], rows[1][0]
    margin = _smallest(rows[0][1 + 2 * m :], zero)
    rates = _rates(margin, J, qd, solved.qdd, tau * qd, solved.effort * qd, *states)
    parts = [x for F in solved.loads for x in (F.real, F.imag)]
    sides = [x for F, guide in zip(solved.loads, guides, strict=True) if guide for x in bearing(F)]
    slips = [zero + 1.0 if x else s for s, x in zip(solved.slips, separates, strict=True)]
    return (*rates, *parts, *_watched(margin, J, inertia_limit), *slips, *sides, *kinks, qd)


def rates_of(
    program: Program, friction: PairFriction | None, signals: SignalProgram, method: Method
) -> CompiledRhs | None:
    """The right-hand side compiled, and steps of a method; None where that cannot be."""
    try:
        if friction is None:
            return _free(program, signals, method)
        return _rubbing(friction, signals, method)
    except (Untraceable, MissingEngineError):
        return None


def _free(program: Program, signals: SignalProgram, method: Method) -> CompiledRhs:
    functions: Data = {"free": free, "acceleration": acceleration}
    bound = bind_functions(functions, PRIMITIVES)
    row, n = bound["free"], len(signals.initial)

    def body(
        run: Callable[..., Reals], q: Real, qd: Real, _: Real, *numbers: Real
    ) -> tuple[Real, ...]:
        x, (t, zero, _unit, inertia_limit) = numbers[:n], numbers[n:]
        inputs = {"q_0": q, "qd_0": qd, "qdd_0": zero, "t": t}
        inputs |= dict(zip(signals.names, x, strict=True))
        values = run(*(inputs[name] for name in program.inputs))
        if n + signals.kinks and "qdd_0" in program.inputs:
            inputs["qdd_0"] = bound["acceleration"](values, qd)
            values = run(*(inputs[name] for name in program.inputs))
        of_state: tuple[Real, ...] = row(values, qd, zero, inertia_limit, n, signals.kinks)
        return of_state

    return CompiledRhs(program, body, 3 + n, 3, 3 + signals.kinks, method)


def acceleration(values: Reals, qd: Real) -> Real:
    """q'' from J, tau and dJ/dq."""
    J, tau, dJ = values[:3]
    return (tau - 0.5 * dJ * qd * qd) / J


def _rubbing(friction: PairFriction, signals: SignalProgram, method: Method) -> CompiledRhs:
    program = friction.program
    m, n, inputs = len(program.names), len(signals.initial), program.compiled_form.inputs
    first, kinks = 2 * m + signals.values, signals.kinks
    functions: Data = {
        "resistance": resistance,
        "rubbing": rubbing,
        "solve": friction.solver,
        "balanced": balanced,
    }
    bound = bind_functions(functions, PRIMITIVES)

    def body(
        run: Callable[..., Planars], q: Real, qd: Real, _: Real, __: Real, *numbers: Real
    ) -> tuple[Real, ...]:
        x, (t, zero, unit, inertia_limit, *sides) = numbers[:n], numbers[n:]

        def state(
            rate: Real,
            qdd: Real,
            share: Real,
            pair: int = -1,
            slips: Reals = (zero,) * m,
            loads: Reals = (zero,) * m,
        ) -> tuple[Planars, Reals]:
            """The row of a state, and what the laws say at relative rates and loads."""
            values_by_name = {"q_0": q, "qd_0": rate, "qdd_0": qdd, "t": t, "load_share": share}
            values_by_name |= {f"friction_{i}": unit if i == pair else zero for i in range(m)}
            values_by_name |= dict(zip(signals.names, x, strict=True))
            values_by_name |= {f"slip_{i}": slip for i, slip in enumerate(slips)}
            values_by_name |= {f"load_{i}": load for i, load in enumerate(loads)}
            values = run(*(values_by_name[x] for x in inputs))
            return values[: len(values) - first], values[len(values) - first :]

        acting, _ = state(qd, zero, unit)

        def laws(loads: Reals = (zero,) * m) -> tuple[Reals, Reals]:
            _, law = state(qd, zero, unit, slips=acting[1 + m : 1 + 2 * m], loads=loads)
            return signed_terms(sides, law[signals.values :], program.drags)

        rows = [acting, state(zero, unit, zero)[0]]
        rows += [state(zero, zero, zero, i)[0] for i in range(m)]
        balance = partial(bound["balanced"], bound["solve"], friction.options)
        solved = bound["resistance"](rows, laws, program.steepest, program.guides, balance)
        inert, _ = state(qd, zero, zero)
        added = state(qd, solved.qdd, unit)[1][: signals.values] if signals.values else ()
        about = program.guides, program.separates
        of_state: tuple[Real, ...] = bound["rubbing"](
            rows, inert, solved, *about, qd, zero, inertia_limit, added[:n], added[n:]
        )
        return of_state

    watched = 3 + m + 2 * sum(program.guides) + kinks
    return CompiledRhs(program.compiled_form, body, 4 + n, 3 + m, watched, method)
