"""Checks of signal blocks: outputs and rates from inputs and states, said in NumPy.

Blocks of other packages, subclasses of these, Python functions and discrete blocks are taken at
their word.

Source: Ogata, Modern Control Engineering, 2010, section 2-3 (block diagrams).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from blockmech.analysis.evidence import TOLERANCE, Evidence, Residual, Term, table_of
from blockmech.model.structure import JointRef, Structure
from blockmech.signals.algebra import DeadZone, Gain, Product, Saturation, Sum
from blockmech.signals.dynamic import BAND, DCMotor, Integrator, Pid, StateSpace, TransferFunction
from blockmech.signals.sources import Constant, Table
from blockmech.typing import Array, Real


def _sum(*terms: Array) -> Term:
    return Term(np.sum(terms, axis=0), np.sum(np.abs(terms), axis=0))


def _signed(b: Sum, *u: Array) -> Term:
    return _sum(*(x if sign == "+" else -x for sign, x in zip(b.signs, u, strict=True)))


def _within(limits: Sequence[float], x: Term) -> Term:
    low, high = limits
    return Term(np.clip(x.value, low, high), x.size + max(abs(low), abs(high)))


def _dead_zone(b: DeadZone, u: Array) -> Term:
    inside = _within(b.limits, Term(u, np.abs(u)))
    return Term(u - inside.value, inside.size)


def _pid(b: Pid, e: Array, integral: Array, filtered: Array) -> Term:
    v = _sum(b.kp * e, b.ki * integral, b.kd * b.n * e, -b.kd * b.n * filtered)
    return _within(b.limits, v) if b.limits else v


def _linear(row: Array, through: float, u: Array, x: Sequence[Array]) -> Term:
    return _sum(*(c * s for c, s in zip(row, x, strict=True)), through * u)


def _table(b: Table, x: Array) -> Term:
    y, moved = (table_of(b.law(), x + step * np.abs(x)) for step in (0.0, TOLERANCE))
    return Term(y, np.abs(y) + np.abs(moved - y) / TOLERANCE + max(map(abs, b.values)))


def _system(b: Any) -> tuple[list[tuple[Array, float]], tuple[Array, float]]:
    """Rows of A beside B, and C beside D; by SciPy states of transfer functions run backwards."""
    from scipy.signal import tf2ss

    if type(b) is StateSpace:
        A, B, C, D = np.array(b.A), b.B, np.array(b.C), b.D
    else:
        A, B, C, D = (x[::-1, ::-1] for x in tf2ss(b.num, b.den))
        B, C, D = B[:, 0], C[0], D[0, 0]
    return [*zip(A, B, strict=True)], (C, D)


def _pid_rates(b: Pid, e: Array, integral: Array, filtered: Array) -> list[Term]:
    """Before a limit the integral comes to rest over the last thousandth of the range."""
    slows: Real = 1.0
    if b.limits:
        v = _pid(b.model_copy(update={"limits": None}), e, integral, filtered).value
        low, high = b.limits
        room = np.where(b.ki * e > 0, high - v, v - low)
        slows = np.clip(room / (BAND * (high - low)), 0.0, 1.0)
    return [Term(e * slows, np.abs(e)), _sum(b.n * e, -b.n * filtered)]


SAID: Mapping[type, Callable[..., Term]] = {
    Constant: lambda b, t: _sum(b.value + 0 * t),
    Sum: _signed,
    Gain: lambda b, u: _sum(b.k * u),
    Product: lambda b, u, v: _sum(u * v),
    Saturation: lambda b, u: _within(b.limits, _sum(u)),
    DeadZone: _dead_zone,
    Table: _table,
    Integrator: lambda b, u, x: _sum(x),
    Pid: _pid,
    StateSpace: lambda b, u, *x: _linear(*_system(b)[1], u, x),
    TransferFunction: lambda b, u, *x: _linear(*_system(b)[1], u, x),
    DCMotor: lambda b, u, w, i: _sum(b.k * i),
}
"""Type -> what a block gives for its inputs and states; the time for one without either."""

RATES: Mapping[type, Callable[..., list[Term]]] = {
    Integrator: lambda b, u, x: [_sum(u)],
    Pid: _pid_rates,
    StateSpace: lambda b, u, *x: [_linear(*row, u, x) for row in _system(b)[0]],
    TransferFunction: lambda b, u, *x: [_linear(*row, u, x) for row in _system(b)[0]],
    DCMotor: lambda b, u, w, i: [_sum(u / b.L, -b.R / b.L * i, -b.k / b.L * w)],
}
"""Type -> the rates of its states for its inputs and these."""


def sources(s: Structure, name: str) -> list[str]:
    """What is wired to the inputs of a block."""
    return [s.signal_wires[JointRef(name, port)] for port in s.signals[name].inputs]


def integrated(s: Structure) -> list[str]:
    """Blocks in continuous time whose states have rates that are said here."""
    return [name for name, b in s.signals.items() if type(b) in RATES and not b.discrete]


def outputs(e: Evidence) -> Iterator[Residual]:
    """What each block of the signal path says."""
    s, run = e.structure, e.run
    for name, block in s.signals.items():
        if type(block) not in SAID or block.discrete:
            continue
        states = (f"{name}.{x}" for x in block.block_states)
        read = [run[source] for source in (*sources(s, name), *states)]
        time = np.zeros(run.n) if run.time is None else np.asarray(run.time)
        y = SAID[type(block)](block, *(read or [time]))
        (port,) = block.outputs
        found = run[f"{name}.{port}"]
        outside = np.isnan(found) & np.isnan(y.value)  # of a table: no number by either
        yield Residual("signal of", name, np.where(outside, 0.0, found - y.value), y.size)
