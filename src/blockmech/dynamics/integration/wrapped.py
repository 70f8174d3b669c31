"""SciPy's own integrators, one leg at a time.

`solve_ivp` keeps nothing of a run that raises. Here an interruption (Ctrl-C, or a user's
event that raises) is held until the next step, which then fails instead: all steps
before it are kept.
"""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np

from blockmech.dynamics.ends import INTERRUPTED, TOO_MANY
from blockmech.dynamics.integration.dips import Dead, Dips, cut_at
from blockmech.dynamics.integration.legs import (
    FINEST,
    Ask,
    Hit,
    Leg,
    Resting,
    TooMany,
    directions,
    first_values,
    scales,
)
from blockmech.dynamics.integration.surfaces import Surface

DIFFERENCE = 1.5e-8  # relative step of a difference quotient
NAMES = {"dop853": "DOP853", "lsoda": "LSODA", "radau": "Radau"}


class _Held:
    """What the steps of a run have met: why it has to stop, or a dead centre."""

    halted = ""
    dead: Dead | None = None

    def __init__(self, ask: Ask) -> None:
        equation = ask.equation
        self.dips = None if equation.margin is None else Dips(equation, ask.t, ask.y)
        self.pieces: list[Any] = []  # dense output of the last two steps

    def after(self, solver: Any) -> None:
        """Look at a step just made; end the run where it met a dead centre."""
        if self.dips is None:
            return
        self.pieces = [*self.pieces[-1:], solver.dense_output()]
        self.dead = self.dips.within(float(solver.t), solver.y, self.state)
        if self.dead is not None:
            solver.status = "finished"

    def state(self, t: float) -> Any:
        """The state at a time within the last two steps."""
        late = len(self.pieces) < 2 or t >= self.pieces[-1].t_min
        return self.pieces[-1 if late else 0](t)


def integrate(ask: Ask, method: str) -> Leg:
    """One leg by `scipy.integrate.solve_ivp`. Raises what interrupts its first step."""
    from scipy.integrate import solve_ivp

    held = _Held(ask)
    rtol, atol = scales(ask.equation, ask.y, ask.tolerance)
    more: dict[str, Any] = {"rtol": rtol}
    if method == "radau":  # it takes one relative tolerance only
        more = {"rtol": max(ask.tolerance, FINEST), "jac": _jacobian(ask)}
    counts = directions(ask)
    told = ({ask.t: value} for value in first_values(ask, counts))
    events = [_event(*given, held) for given in zip(ask.surfaces, counts, told, strict=True)]
    with warnings.catch_warnings():
        # where LSODA gives up it warns of that as well; the run says it
        warnings.filterwarnings("ignore", category=UserWarning, module=r"scipy\.integrate")
        solution = solve_ivp(
            ask.rhs,
            (ask.t, ask.end),
            ask.y,
            method=_patient(NAMES[method]),
            held=held,
            atol=atol,
            dense_output=True,
            events=events,
            max_step=ask.longest,
            **more,
        )
    if held.halted == INTERRUPTED and solution.t.size < 2:
        raise KeyboardInterrupt
    tiny = 4 * np.finfo(float).eps * max(abs(ask.t), abs(float(solution.t[-1])))
    hits = [
        Hit(surface, float(t), y)
        for surface, times, states in zip(
            ask.surfaces, solution.t_events, solution.y_events, strict=True
        )
        for t, y in zip(times, states, strict=True)
        if t - ask.t > tiny
    ]
    hits.sort(key=lambda hit: (hit.t, hit.surface.terminal))
    t1, y1, dead = float(solution.t[-1]), solution.y[:, -1].copy(), held.dead
    if dead is not None and dead.t < t1:
        hits, last = cut_at(dead, ask, hits, [])
        hits, t1, y1 = hits + last, dead.t, np.array(dead.y)
    return Leg(
        t0=ask.t,
        t1=t1,
        y1=y1,
        dense=solution.sol if solution.t.size > 1 else Resting(ask.y),
        hits=tuple(hits),
        failed=solution.status == -1 and not held.halted,
        turned=float(np.abs(solution.y[-1]).max()),
        marks=solution.t[:-1],
        halted=held.halted,
    )


def _jacobian(ask: Ask) -> Any:
    """df/dy by differences; nothing depends on the work, which is the last state.

    States are moved back against the motion: ahead there may be no pose, or a load no value.
    """
    k, w = ask.equation.drivers, ask.equation.speed

    kinks = [surface.value for surface in ask.surfaces if surface.kind == "knot"]

    def jacobian(t: float, y: Any) -> Any:
        base = np.asarray(ask.rhs(t, y))
        steps = DIFFERENCE * np.maximum(np.abs(y), [1e-3] * k + [1e-3 * w] * k + [1.0])
        steps[: 2 * k] *= np.where(base[: 2 * k] > 0, -1.0, 1.0)
        columns = np.zeros((y.size, y.size))
        for i in range(2 * k):
            moved = y.copy()
            moved[i] += steps[i]
            if any(kink(t, y) * kink(t, moved) < 0 for kink in kinks):
                moved[i] = y[i] - steps[i]  # a load may jump there
            columns[:, i] = (np.asarray(ask.rhs(t, moved)) - base) / (moved[i] - y[i])
        return columns

    return jacobian


@cache
def _patient(name: str) -> Any:
    """A solver of SciPy whose step fails, and does not raise, when the user interrupts it."""
    from scipy import integrate as scipy_integrate

    solver: Any = getattr(scipy_integrate, name)

    class Patient(solver):  # type: ignore[misc]
        status: str

        def __init__(self, *given: Any, held: _Held, **more: Any) -> None:
            self.held = held
            super().__init__(*given, **more)

        def step(self) -> Any:
            if not self.held.halted:
                try:
                    with np.errstate(all="ignore"):  # of stages where there is no pose
                        message = super().step()
                    made = self.status != "failed"
                    if made and np.isfinite(self.y).all():  # LSODA takes a step to no pose for one
                        self.held.after(self)
                        return message
                except KeyboardInterrupt:
                    self.held.halted = INTERRUPTED
                except TooMany:
                    self.held.halted = TOO_MANY
                except (ValueError, ArithmeticError, np.linalg.LinAlgError):
                    pass  # of numbers that are none: there is no pose ahead
            self.status = "failed"
            return self.held.halted

        def dense_output(self) -> Any:
            try:
                return super().dense_output()
            except KeyboardInterrupt:
                self.held.halted = INTERRUPTED
            except TooMany:
                self.held.halted = TOO_MANY
            return super().dense_output()

    return Patient


def _event(surface: Surface, direction: int, told: dict[float, float], held: _Held) -> Any:
    """A surface for SciPy, which asks at the end of each step, then between the last two ends.

    ``told`` are its values by time: at the start, of the last two ends and between. At an end
    itself it must be told the same again, though the interpolant may be off there by rounding:
    between ends of the same sign it finds no root, and raises.
    """

    def event(t: float, y: Any) -> float:
        newest = max(told, default=t)
        if t in told or held.halted:
            return told.get(t, told.get(newest, 0.0))
        if t > newest:
            last = told[newest]
            told.clear()
            told[newest] = last
        try:
            told[t] = surface.value(t, y)
        except KeyboardInterrupt:
            held.halted = INTERRUPTED
            return told.get(newest, 0.0)
        return told[t]

    event.direction = direction  # type: ignore[attr-defined]
    event.terminal = surface.terminal  # type: ignore[attr-defined]
    return event
