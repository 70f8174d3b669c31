r"""The driving effort and its derivatives: what equilibria and linear models are made of.

The effort that the drivers need for a motion,

    u(q, q', q'', t) = M q'' + c - Q,

is one program of the reduction pass, without joint friction. Run on dual numbers it gives at once

    M = du/dq''      C = du/dq'      K = du/dq

exact to rounding, whatever loads act: an equilibrium is u = 0 at rest, and a small disturbance
of it obeys M x'' + C x' + K x = 0. Laws that are a user's function of Python have their
derivatives by differences.

Sources: Shabana, Dynamics of Multibody Systems, 4th ed., ch. 3 (linearised equations);
`blockmech.engines.derivatives`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from blockmech.dynamics.source import FRICTIONLESS, Source, margins
from blockmech.engines.derivatives import WITH_DIFFERENCES, Dual, DualEngine, value
from blockmech.ground.errors import refused
from blockmech.passes import reduction
from blockmech.passes.homotopy import schedule
from blockmech.typing import Arguments, Floats

INPUTS = ("q", "qd", "qdd")


class Tangents(NamedTuple):
    """The driving effort at n states of k drivers, with its derivatives.

    effort : (n, k) [N m or N] that the drivers need; the loads alone give its negative
    M, C, K : (n, k, k) by accelerations, rates and coordinates
    margin : (n,) [-] of the pose, NaN or not positive where it cannot be
    """

    effort: Floats
    M: Floats
    C: Floats
    K: Floats
    margin: Floats


def tangents(
    compiled: Source,
    q: ArrayLike,
    qd: ArrayLike = 0.0,
    qdd: ArrayLike = 0.0,
    t: ArrayLike = 0.0,
) -> Tangents:
    """The driving effort and its derivatives at states (n, k), without joint friction."""
    refuse_signals(compiled)
    engine = compiled._once(_effort)
    k = len(compiled.structure.drivers)
    q = np.asarray(q, float).reshape(-1, k)
    columns_by_name: Arguments = {"t": np.broadcast_to(np.asarray(t, float), len(q))}
    for which, (name, x) in enumerate(zip(INPUTS, (q, qd, qdd), strict=True)):
        columns = np.broadcast_to(np.asarray(x, float), q.shape)
        for i in range(k):
            seed = np.zeros((3 * k, len(q)))
            seed[which * k + i] = 1.0
            columns_by_name[f"{name}_{i}"] = Dual(columns[:, i], seed)
    program = engine.program
    inputs = {name: columns_by_name[name] for name in program.inputs}
    values = engine.run(inputs, tuple(program.parameters.values()), len(q), 3 * k)
    u, rest = values[:k], values[k:]
    slopes = np.array([x.d for x in u]).transpose(2, 0, 1)  # (n, k, 3k)
    margin = np.minimum.reduce([np.ones(len(q)), *(value(x) for x in rest)])
    K, C, M = (slopes[..., j * k : (j + 1) * k] for j in range(3))
    return Tangents(np.stack([x.x for x in u], axis=-1), M, C, K, np.asarray(margin))


def refuse_signals(compiled: Source) -> None:
    """Raise `RequestError` where loads follow signals, whose states are no coordinates."""
    if compiled.structure.signals:
        fault = "loads follow signals, whose states stand beside the coordinates"
        raise refused("signals", fault, "take the signals out, or simulate the motion")


def refuse_friction_states(compiled: Source) -> None:
    """Raise `RequestError` where a joint has a friction law that remembers."""
    if compiled.structure.remembering:
        fault = "it has a friction law with a state, which stands beside the coordinates"
        remedy = 'leave joint friction out with friction="none", or simulate the motion'
        raise refused(str(compiled.structure.remembering[0]), fault, remedy)


def _effort(compiled: Source) -> DualEngine:
    s = schedule(compiled.structure, compiled.scene, FRICTIONLESS)
    efforts = [s.ask(reduction.drive_by_reduction, k) for k in compiled.structure.drivers]
    return DualEngine(s.program([*efforts, *margins(s)]), WITH_DIFFERENCES)
