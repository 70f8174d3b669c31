r"""The blow of the drives where a change of roles stops a driver, or takes it along, at once.

With the drivers c that are not free then, and f that are,

    M_ff dq'_f = -M_fc dq'_c + S^T T + n^T P,        dq'_c = q'_c of the law, or 0, less that before

which is an impact (`blow`) whose drives are target at the jumps of their rates.
"""

from __future__ import annotations

import numpy as np

from blockmech.dynamics.blow import Before, blow, impact_of
from blockmech.dynamics.contacts import SETTLED, STILL
from blockmech.dynamics.equation import Equation
from blockmech.dynamics.roles import Roles
from blockmech.ground.errors import refused
from blockmech.result.motion import Impact
from blockmech.typing import Floats


def jolt_of(
    equation: Equation, roles: Roles, watch: str, t: float, y: Floats
) -> tuple[Impact | None, float]:
    """The blow of the drives that new roles of an event bring about; None where no rate jumps.

    Beside it what the drives work [J], which go on at their rates: what is missing then is lost
    (Carnot's theorem).

    Raises `RequestError` where a driver is not where the law says that it is to follow.
    """
    system, (q, before) = equation.system, equation.layout.motion(y.copy())
    for i in roles.prescribed:
        coordinate = roles.law_at(i, t)[0]
        if not abs(coordinate - q[i]) <= SETTLED * max(1.0, abs(q[i])):
            name = roles.drivers[i]
            fault = f"at t = {t:.9g} s {name}.q is {q[i]:.9g}, and its law of motion says "
            fault += f"{coordinate:.9g}"
            remedy = "let the event be where the two meet, or lock the driver"
            raise refused(f"watch.{watch}.then.{name}", fault, remedy, code="roles")
    target = roles.constraint(t)
    assert target.speeds is not None
    jump = target.speeds - before[roles.bound]
    moving = np.abs(jump) > STILL * np.abs(before).max(initial=0.0)
    if not moving.any():
        return None, 0.0
    x = y[equation.layout.signals] if equation.layout.initial else None
    state = Before(t, q, before, system.terms_of(q, before, t, x)[0].M, x)
    those, friction = sorted(system.contacts), system.friction
    stops, ways = system.pairs.constraints(q, before, those), [system.contacts[i] for i in those]
    bound = target._replace(drift=-jump, speeds=None)
    blown = blow(state, stops, np.array(ways), np.zeros(len(those)), friction, bound)
    blown.after[roles.bound] = target.speeds
    names = [*(system.stopped[i] for i in those), *(roles.drivers[i] for i in roles.bound)]
    record, work = impact_of(blown, state, names, roles.bound, friction)
    first = roles.drivers[roles.bound[int(np.argmax(np.abs(jump)))]]
    return record._replace(driver=first, impulse=record.pushes[first]), work
