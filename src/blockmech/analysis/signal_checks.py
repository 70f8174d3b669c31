"""Checks of signal blocks: outputs and rates of states from inputs and states, said in NumPy.

Blocks of other packages, subclasses of these, Python functions and discrete blocks are taken at
their word.

Source: Ogata, Modern Control Engineering, 2010, section 2-3 (block diagrams).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from blockmech.analysis.evidence import TOLERANCE, Evidence, Residual, Term
from blockmech.analysis.free_bodies import Array
from blockmech.analysis.load_checks import table_of
from blockmech.model.structure import JointRef
from blockmech.signals.algebra import DeadZone, Gain, Product, Saturation, Sum
from blockmech.signals.dynamic import BAND, DCMotor, Integrator, Pid, StateSpace, TransferFunction
from blockmech.signals.sources import Constant, Table

if TYPE_CHECKING:
    from blockmech.model.structure import Structure
    from blockmech.result import Result

Said: TypeAlias = tuple[Term, Sequence[Array]]
"""The output with the size of its terms, and the rates of the states."""


def _sum(*terms: Array) -> Term:
    return Term(np.sum(terms, axis=0), np.sum(np.abs(terms), axis=0))


def _signed(b: Sum, *u: Array) -> Said:
    return _sum(*(x if sign == "+" else -x for sign, x in zip(b.signs, u, strict=True))), ()


def _within(limits: Sequence[float], x: Term) -> Term:
    low, high = limits
    return Term(np.clip(x.value, low, high), x.size + max(abs(low), abs(high)))


def _dead_zone(b: DeadZone, u: Array) -> Said:
    inside = _within(b.limits, Term(u, np.abs(u)))
    return Term(u - inside.value, inside.size), ()


def _pid(b: Pid, e: Array, integral: Array, filtered: Array) -> Said:
    slope = b.n * (e - filtered)
    v, rate = _sum(b.kp * e, b.ki * integral, b.kd * b.n * e, -b.kd * b.n * filtered), e
    if b.limits:
        low, high = b.limits
        room = np.where(b.ki * e > 0, high - v.value, v.value - low) / (BAND * (high - low))
        v, rate = _within(b.limits, v), e * np.clip(room, 0, 1)
    return v, (rate, slope)


def _linear(A: Array, B: Array, C: Array, D: float, u: Array, x: Sequence[Array]) -> Said:
    return _sum(*(c * s for c, s in zip(C, x, strict=True)), D * u), list(A @ x + np.outer(B, u))


def _transfer_function(b: TransferFunction, u: Array, *x: Array) -> Said:
    """By the controller form of `scipy.signal`, whose states are in the other order."""
    from scipy.signal import tf2ss

    A, B, C, D = tf2ss(b.num, b.den)
    y, rates = _linear(A, B[:, 0], C[0], D[0, 0], u, x[::-1])
    return y, rates[::-1]


def _table(b: Table, x: Array) -> Said:
    y, moved = (table_of(b.law(), x + step * np.abs(x)) for step in (0.0, TOLERANCE))
    return Term(y, np.abs(y) + np.abs(moved - y) / TOLERANCE + max(map(abs, b.values))), ()


SAID: Mapping[type, Callable[..., Said]] = {
    Constant: lambda b, t: (_sum(b.value + 0 * t), ()),
    Sum: _signed,
    Gain: lambda b, u: (_sum(b.k * u), ()),
    Product: lambda b, u, v: (_sum(u * v), ()),
    Saturation: lambda b, u: (_within(b.limits, _sum(u)), ()),
    DeadZone: _dead_zone,
    Table: _table,
    Integrator: lambda b, u, x: (_sum(x), (u,)),
    Pid: _pid,
    StateSpace: lambda b, u, *x: _linear(np.array(b.A), b.B, b.C, b.D, u, x),
    TransferFunction: _transfer_function,
    DCMotor: lambda b, u, w, i: (_sum(b.k * i), ((u - b.R * i - b.k * w) / b.L,)),
}
"""Type -> what a block gives for its inputs and states; the time for one without either."""


def _judged(s: Structure, run: Result) -> Iterator[tuple[str, Any, Said]]:
    for name, block in s.signals.items():
        if type(block) not in SAID or block.discrete:
            continue
        sources = [s.signal_wires[JointRef(name, port)] for port in block.inputs]
        read = [run[source] for source in (*sources, *(f"{name}.{x}" for x in block.own_states))]
        time = np.zeros(run.n) if run.time is None else np.asarray(run.time)
        yield name, block, SAID[type(block)](block, *(read or [time]))


def outputs(e: Evidence) -> Iterator[Residual]:
    """What each block of the signal path says."""
    for name, block, (y, _) in _judged(e.structure, e.run):
        (port,) = block.outputs
        yield Residual("signal of", name, e.run[f"{name}.{port}"] - y.value, y.size)
