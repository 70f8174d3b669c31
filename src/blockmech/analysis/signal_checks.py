"""Checks of signal blocks: outputs from inputs and states, said in NumPy.

Blocks of other packages, subclasses of these, Python functions and discrete blocks are taken at
their word.

Source: Ogata, Modern Control Engineering, 2010, section 2-3 (block diagrams).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from blockmech.analysis.evidence import TOLERANCE, Evidence, Residual, Term
from blockmech.analysis.free_bodies import Array
from blockmech.analysis.load_checks import table_of
from blockmech.model.structure import JointRef
from blockmech.signals.algebra import DeadZone, Gain, Product, Saturation, Sum
from blockmech.signals.dynamic import DCMotor, Integrator, Pid, StateSpace, TransferFunction
from blockmech.signals.sources import Constant, Table


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


def _linear(C: Sequence[float], D: float, u: Array, x: Sequence[Array]) -> Term:
    return _sum(*(c * s for c, s in zip(C, x, strict=True)), D * u)


def _transfer_function(b: TransferFunction, u: Array, *x: Array) -> Term:
    """By the controller form of `scipy.signal`, whose states are in the other order."""
    from scipy.signal import tf2ss

    _, _, C, D = tf2ss(b.num, b.den)
    return _linear(C[0], D[0, 0], u, x[::-1])


def _table(b: Table, x: Array) -> Term:
    y, moved = (table_of(b.law(), x + step * np.abs(x)) for step in (0.0, TOLERANCE))
    return Term(y, np.abs(y) + np.abs(moved - y) / TOLERANCE + max(map(abs, b.values)))


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
    StateSpace: lambda b, u, *x: _linear(b.C, b.D, u, x),
    TransferFunction: _transfer_function,
    DCMotor: lambda b, u, w, i: _sum(b.k * i),
}
"""Type -> what a block gives for its inputs and states; the time for one without either."""


def outputs(e: Evidence) -> Iterator[Residual]:
    """What each block of the signal path says."""
    s, run = e.structure, e.run
    for name, block in s.signals.items():
        if type(block) not in SAID or block.discrete:
            continue
        sources = [s.signal_wires[JointRef(name, port)] for port in block.inputs]
        read = [run[source] for source in (*sources, *(f"{name}.{x}" for x in block.own_states))]
        time = np.zeros(run.n) if run.time is None else np.asarray(run.time)
        y = SAID[type(block)](block, *(read or [time]))
        (port,) = block.outputs
        found = run[f"{name}.{port}"]
        outside = np.isnan(found) & np.isnan(y.value)  # of a table: no number by either
        yield Residual("signal of", name, np.where(outside, 0.0, found - y.value), y.size)
