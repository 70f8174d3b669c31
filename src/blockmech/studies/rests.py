r"""What a design is where it comes to rest: outputs at its stable equilibrium, and derivatives.

Of the stable equilibria the one nearest to the first pose is meant, friction of joints left out.
With the effort Q(q, p) of the loads, zero there, it moves with a number p of the design by

    dq/dp = -(dQ/dq)^-1 dQ/dp,    dy/dp = y_p + y_q dq/dp,

an end stop that holds it does not move.

Source: Shabana, Dynamics of Multibody Systems, 4th ed.; the implicit function theorem.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from blockmech.dynamics.loads import period_of
from blockmech.ground.errors import refused
from blockmech.result.samples import Samples
from blockmech.typing import Array, Data, Floats


class Rest(NamedTuple):
    """Where a mechanism rests.

    at : driver -> coordinate [rad or m]
    stop : whether an end stop holds it
    jump : of the effort, so that the place has no derivative
    """

    at: dict[str, float]
    stop: bool
    jump: bool

    @property
    def still(self) -> Data:
        """The pose at rest, as a run takes it."""
        none = dict.fromkeys(self.at, 0.0)
        poses = {driver: [q] for driver, q in self.at.items()}
        return {"at": poses, "rates": none, "accelerations": none, "friction": "none"}


def rest_of(mechanism: Any, samples: Samples) -> Rest | None:
    """The stable equilibrium nearest to the first of some poses; None where there is none.

    Raises `RequestError` where loads follow the time or signals.
    """
    drivers = mechanism.drivers
    first = np.array([float(np.ravel(samples.coordinate(i))[0]) for i in range(len(drivers))])
    s, stops = mechanism.structure, mechanism.scene.stops
    periods = [0.0 if d in stops else period_of(s, d) or 0.0 for d in drivers]
    time = None if samples.times is None else float(samples.times[0])

    def near(q: Floats) -> Floats:
        ways = zip(q, first, periods, strict=True)
        return np.array([x + p * round((to - x) / p) if p else x for x, to, p in ways])

    equilibria = [
        (near(e.q), e) for e in mechanism.equilibria(friction="none", time=time, charts=False)
        if e.kind == "stable"
    ]  # fmt: skip
    if not equilibria:
        return None
    q, e = min(equilibria, key=lambda row: float(np.abs(row[0] - first).max()))
    return Rest(dict(zip(drivers, q.tolist(), strict=True)), e.stop, e.jump)


def rest_value(mechanism: Any, samples: Samples, output: str) -> Any:
    """An output where a mechanism rests; NaN where it does not."""
    rest = rest_of(mechanism, samples)
    if rest is None:
        return np.nan
    return np.ravel(mechanism.run(want=[output], **rest.still)[output])[0]


def rest_slopes(
    mechanism: Any, samples: Samples, output: str, to: Sequence[str]
) -> tuple[Array, tuple[Array, Array]]:
    """An output where a mechanism rests, and its derivatives (k, 1) to both sides.

    Raises `RequestError` where no stable equilibrium exists, or the effort jumps there.
    """
    rest = rest_of(mechanism, samples)
    label = f"rest({output})"
    if rest is None:
        raise refused(label, "no stable equilibrium exists", "change the loads or the stops")
    if rest.jump:
        found = "the effort of the loads jumps where it rests"
        raise refused(
            label, found, "it does not depend smoothly on any number", code="no-derivative"
        )
    drivers = mechanism.drivers
    efforts = [mechanism._of_driver(d, "tau_red") for d in drivers]
    coordinates = [mechanism._of_driver(d, "q") for d in drivers]
    of = mechanism.sensitivity([output, *efforts], [*to, *coordinates], **rest.still)
    sides = []
    for d in (of.ahead, of.behind):
        slopes, k = np.asarray(d[output])[:, 0], len(to)
        effort = np.array([d[name][:, 0] for name in efforts])
        if not rest.stop:
            moved = -np.linalg.solve(effort[:, k:], effort[:, :k])
            slopes = slopes[:k] + slopes[k:] @ moved
        sides.append(slopes[:k, None])
    return np.asarray(of.result[output]), (sides[0], sides[1])
