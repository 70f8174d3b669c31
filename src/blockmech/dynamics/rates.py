r"""The right-hand side as machine code: what `equation` says, a state or a step.

A row of numbers tells of a state (q, q', W), with joint friction (q, q', W, F):

    the rates of the state, margin, J, real and imaginary part of the load on each pair, and what
    is watched: margin and J above the least that counts (J in usual ones), slips of the pairs,
    sides of guides, kinks of signals, q'

Of several drivers J is a usual one, slips are those at their rates, and 1 stands for q'.

Given are 0, 1 (states of the force pass are made of them; nothing is folded), the least J and the
directions of slip. The text is made of the programs that are interpreted otherwise, so both
say the same to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from blockmech.dynamics.source import by_name
from blockmech.engines.binding import bind_functions
from blockmech.engines.compiled_rates import CompiledRhs
from blockmech.engines.nodes import Untraceable
from blockmech.engines.stages import Method
from blockmech.engines.trace import PRIMITIVES
from blockmech.friction.equations import along, eliminate, loads
from blockmech.friction.solvers import Solution, balanced
from blockmech.ground.errors import MissingEngineError
from blockmech.ground.plane import NAN, minimum, mul, where
from blockmech.ground.tolerances import BLUR as LEAST_MARGIN
from blockmech.ground.tolerances import EQUAL
from blockmech.typing import Complex, Data, Edges, Planars, Real, Reals

if TYPE_CHECKING:
    from blockmech.dynamics.friction import PairFriction
    from blockmech.dynamics.programs import SignalProgram
    from blockmech.plan.plan import Program

LEAST_INERTIA = EQUAL  # [-] of a typical one: beyond it the speed goes without bound


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

    qdd : (k,) accelerations of the drivers
    slips : (m, k) relative rates of the pairs per unit rate of the drivers
    effort : (k,) [N m or N] that friction takes
    loads : (m,) on the pairs
    """

    qdd: Reals
    slips: Sequence[Reals]
    effort: Reals
    loads: Planars


def resistance(
    rows: Sequence[Planars],
    laws: Callable[..., tuple[Reals, Reals]],
    steepest: Reals,
    guides: Edges,
    balance: Callable[..., Solution],
) -> FrictionSolution:
    """Friction from the program's values, with laws and their slopes as of `solvers.balanced`.

    ``rows`` are those of the loads at the rates, of a unit of each q'', of a unit of each friction;
    ``balance`` is that function with a solver.
    """
    m, k = len(guides), len(rows) - 1 - len(guides)
    acting, units, rubs = rows[0], rows[1 : 1 + k], rows[1 + k :]
    M = [[unit[i] for unit in units] for i in range(k)]
    push, slips = [-x for x in acting[:k]], [[-x for x in row[:k]] for row in rubs]
    by_loads, *by_friction = eliminated(M, push, *slips)

    def load(first: Planars, qdd: Reals, j: int) -> Complex:
        total = first[k + j]
        for unit, x in zip(units, qdd, strict=True):
            total = total + mul(unit[k + j], x)
        return total

    base = tuple(load(acting, by_loads, j) for j in range(m))
    matrix = tuple(
        tuple(load(row, qdd, j) for row, qdd in zip(rubs, by_friction, strict=True))
        for j in range(m)
    )
    solution = balance(laws, steepest, guides, base, matrix)
    effort = [0.0 * M[0][0]] * k
    for row, t in zip(slips, solution.t, strict=True):
        effort = [x - s * t for x, s in zip(effort, row, strict=True)]
    (qdd,) = eliminated(M, [x - y for x, y in zip(push, effort, strict=True)])
    return FrictionSolution(qdd, slips, effort, loads(solution.t, base, matrix))


def eliminated(M: Sequence[Reals], *pushes: Reals) -> list[Reals]:
    """Accelerations (k,) by each of some efforts (k,)."""
    columns = zip(*pushes, strict=True)
    return [*eliminate([[*row, *x] for row, x in zip(M, columns, strict=True)])[0]]


def accelerations(values: Reals, qd: Reals) -> Reals:
    """q'' (k,) from the inertia, the loads, and the inertia's slope or the bias."""
    k = len(qd)
    Q, c = values[k * k : k * k + k], values[k * k + k : k * k + 2 * k]
    bias = c if k > 1 else [0.5 * c[0] * qd[0] * qd[0]]
    M = [values[i * k : i * k + k] for i in range(k)]
    return eliminated(M, [x - y for x, y in zip(Q, bias, strict=True)])[0]


def free(
    values: Reals, qd: Reals, zero: Real, inertia_limit: Real, states: int, kinks: int
) -> tuple[Real, ...]:
    """The row of a state without friction, from values of the equation of motion."""
    k = len(qd)
    J, Q, rest = values[0], values[k * k : k * k + k], values[k * k + 2 * k :]
    J = J if k == 1 else inertia_limit
    margin, state_rates = _smallest(rest[states + kinks :], zero), rest[:states]
    rates = _rates(margin, J, qd, accelerations(values, qd), along(Q, qd), *state_rates)
    watched = rest[states : states + kinks]
    return (*rates, *_watched(margin, J, inertia_limit), *watched, _turn(qd, zero))


def _turn(qd: Reals, zero: Real) -> Real:
    """What changes its sign where the only driver stands still."""
    return qd[0] if len(qd) == 1 else zero + 1.0


def _watched(margin: Real, J: Real, inertia_limit: Real) -> tuple[Real, ...]:
    return margin - LEAST_MARGIN, J / inertia_limit * LEAST_INERTIA - LEAST_INERTIA


def _rates(margin: Real, J: Real, qd: Reals, qdd: Reals, *powers: Real) -> tuple[Real, ...]:
    """Rates of the state, margin and J; no rates where there is no pose."""
    possible = margin > 0.0
    rates = (*qd, *(where(J > 0.0, x, NAN) for x in qdd), *powers)
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
    idle: Sequence[Real],
    qd: Reals,
    zero: Real,
    inertia_limit: Real,
    states: Reals,
    kinks: Reals,
) -> tuple[Real, ...]:
    """The row of a state with friction, from rows of the force pass and what friction does.

    ``inert`` is the row at the same rates without loads; ``idle`` (m,) are pairs without slip.
    """
    m, k, acting = len(solved.slips), len(qd), rows[0]
    Q, J = [x - y for x, y in zip(inert[:k], acting[:k], strict=True)], rows[1][0]
    J = J if k == 1 else inertia_limit
    margin = _smallest(acting[k + 2 * m :], zero)
    powers = along(Q, qd), along(solved.effort, qd)
    rates = _rates(margin, J, qd, solved.qdd, *powers, *states)
    parts = [x for F in solved.loads for x in (F.real, F.imag)]
    sides = [x for F, guide in zip(solved.loads, guides, strict=True) if guide for x in bearing(F)]
    slips = [s[0] for s in solved.slips] if k == 1 else acting[k + m : k + 2 * m]
    slips = [where(x, zero + 1.0, s) for s, x in zip(slips, idle, strict=True)]
    dips = _watched(margin, J, inertia_limit)
    return (*rates, *parts, *dips, *slips, *sides, *kinks, _turn(qd, zero))


def rates_of(
    program: Program, friction: PairFriction | None, signals: SignalProgram, k: int, method: Method
) -> CompiledRhs | None:
    """The right-hand side compiled, and steps of a method; None where that cannot be."""
    try:
        if friction is None:
            return _free(program, signals, method, k)
        return _rubbing(friction, signals, method, k)
    except (Untraceable, MissingEngineError, ZeroDivisionError):  # no inertia at all
        return None


def _free(program: Program, signals: SignalProgram, method: Method, k: int) -> CompiledRhs:
    functions: Data = {"free": free, "accelerations": accelerations}
    bound = bind_functions(functions, PRIMITIVES)
    row, n = bound["free"], len(signals.initial)

    def body(run: Callable[..., Reals], *numbers: Real) -> tuple[Real, ...]:
        qd, (t, zero, _unit, inertia_limit) = numbers[k : 2 * k], numbers[2 * k + 1 + n :]
        inputs = by_name(numbers[:k], qd, (zero,) * k, numbers[2 * k + 1 :][:n]) | {"t": t}
        values = run(*(inputs[name] for name in program.inputs))
        if n + signals.kinks and any(name.startswith("qdd_") for name in program.inputs):
            inputs |= by_name(qdd=bound["accelerations"](values, qd))
            values = run(*(inputs[name] for name in program.inputs))
        of_state: tuple[Real, ...] = row(values, qd, zero, inertia_limit, n, signals.kinks)
        return of_state

    return CompiledRhs(program, body, 2 * k + 1 + n, 3, 3 + signals.kinks, method)


def _rubbing(friction: PairFriction, signals: SignalProgram, method: Method, k: int) -> CompiledRhs:
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

    def body(run: Callable[..., Planars], *numbers: Real) -> tuple[Real, ...]:
        q, qd, x = numbers[:k], numbers[k : 2 * k], numbers[2 * k + 2 :][:n]
        t, zero, unit, inertia_limit, *sides = numbers[2 * k + 2 + n :]
        still, nothing = (zero,) * k, (zero,) * m

        def state(
            rates: Reals,
            qdd: Reals,
            share: Real,
            pair: int = -1,
            slips: Reals = nothing,
            loads: Reals = nothing,
        ) -> tuple[Planars, Reals]:
            """The row of a state, and what the laws say at relative rates and loads."""
            values_by_name = by_name(q, rates, qdd, x) | {"t": t, "load_share": share}
            values_by_name |= {f"friction_{i}": unit if i == pair else zero for i in range(m)}
            values_by_name |= {f"slip_{i}": slip for i, slip in enumerate(slips)}
            values_by_name |= {f"load_{i}": load for i, load in enumerate(loads)}
            if not values_by_name.keys() >= {*inputs}:
                raise Untraceable("a force of an end stop is found between segments")
            values = run(*(values_by_name[x] for x in inputs))
            return values[: len(values) - first], values[len(values) - first :]

        acting, _ = state(qd, still, unit)

        def laws(loads: Reals = nothing) -> tuple[Reals, Reals]:
            _, law = state(qd, still, unit, slips=acting[k + m : k + 2 * m], loads=loads)
            return signed_terms(sides, law[signals.values :], program.drags)

        units = [[unit if i == j else zero for j in range(k)] for i in range(k)]
        rows = [acting, *(state(still, qdd, zero)[0] for qdd in units)]
        rows += [state(still, still, zero, i)[0] for i in range(m)]
        balance = partial(bound["balanced"], bound["solve"], friction.options)
        solved = bound["resistance"](rows, laws, program.steepest, program.guides, balance)
        inert, _ = state(qd, still, zero)
        added = state(qd, solved.qdd, unit)[1][: signals.values] if signals.values else ()
        idle = [
            (zero if x else side) == 0.0 for x, side in zip(program.separates, sides, strict=True)
        ]
        about = program.guides, idle
        of_state: tuple[Real, ...] = bound["rubbing"](
            rows, inert, solved, *about, qd, zero, inertia_limit, added[:n], added[n:]
        )
        return of_state

    watched = 3 + m + 2 * sum(program.guides) + kinks
    return CompiledRhs(program.compiled_form, body, 2 * k + 2 + n, 3 + m, watched, method)
