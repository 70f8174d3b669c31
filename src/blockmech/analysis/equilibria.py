r"""Equilibria: where a mechanism comes to rest under its loads, and whether it stays there.

At rest the drivers need the effort u(q) = -Q(q); an equilibrium is u = 0, its stiffness K = du/dq
is exact by `blockmech.dynamics.programs`. One driver is searched over its whole range
(`blockmech.analysis.equilibria_one`), several from many places and along curves
(`blockmech.analysis.equilibria_several`).

Source: Shabana, Dynamics of Multibody Systems, 4th ed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from blockmech.analysis.equilibria_charts import equilibria_through_charts
from blockmech.analysis.equilibria_one import Line, equilibria_of_one
from blockmech.analysis.equilibria_several import STARTS, equilibria_of_several
from blockmech.analysis.equilibrium import Equilibria
from blockmech.dynamics.programs import refuse_signals
from blockmech.dynamics.system import System
from blockmech.ground.arguments import declared
from blockmech.ground.errors import refused
from blockmech.plan.settings import friction_asked
from blockmech.typing import FrictionMethod

if TYPE_CHECKING:
    from blockmech.compiled import Compiled


@declared
def equilibria(
    mechanism: Compiled,
    *,
    friction: FrictionMethod | None = None,
    time: float | None = None,
    starts: int = STARTS,
    charts: bool = True,
) -> Equilibria:
    """All static equilibria under the loads alone, and their stability.

    With one driver the search covers its range between the end stops and continues beyond its dead
    centres, where another joint is the coordinate (`Equilibrium.leads`). With several drivers it
    uses Newton's method from many starting points, and follows the curves on which all drivers but
    one are balanced. Joint friction
    widens an equilibrium of one driver to the interval in which it rests.

    Parameters
    ----------
    friction : as that of a run; "none" leaves the friction of joints out
    time : [s] at which loads that follow the time are held
    starts : starting coordinates of each driver, where there are several
    charts : whether the search continues beyond dead centres of the only driver

    Returns
    -------
    Equilibria, a sequence of `Equilibrium`

    Raises
    ------
    RequestError without ``time`` where loads depend on it, and without a driver

    >>> six = bm.read("graphs/watt_sixbar.json").compile()
    >>> round(six.equilibria().stable[0].at["crank.q"], 6)
    4.612579
    """
    if not mechanism.drivers:
        raise refused("equilibria", "the mechanism has no driver", "give one joint a driver")
    refuse_signals(mechanism)
    how = friction_asked(friction)
    bounds = (mechanism.scene.stops.get(d) for d in mechanism.drivers)
    stops = tuple((-math.inf, math.inf) if s is None else s.bounds for s in bounds)
    one = len(mechanism.drivers) == 1
    system = System(mechanism, stops=stops, method=how if one else None)
    if "time" in system.depends_on and time is None:
        found = "loads follow the time, so nothing stays at rest"
        raise refused("time", found, "give time=, at which they are held")
    t = 0.0 if time is None else float(time)
    if one:
        line = Line(mechanism, system, t)
        return equilibria_through_charts(line) if charts else equilibria_of_one(line)
    return equilibria_of_several(mechanism, system, t, starts)
