"""The facade: a compiled mechanism with all its analyses as methods.

It stands above every analysis and is imported by none: they take a `Compiled`. Each method
is the function of that name, so its arguments are declared there and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from blockmech.compiled import Compiled
from blockmech.errors import BlockmechError
from blockmech.quality import Flag
from blockmech.result import Result
from blockmech.runnable import LazyMethod
from blockmech.samples import Samples

if TYPE_CHECKING:
    import blockmech.analysis.explain as explaining
    import blockmech.analysis.extremes as extremal
    import blockmech.analysis.instants as instants
    import blockmech.analysis.stroke as stroking
    import blockmech.draw.arcs as closing
    import blockmech.draw.balance as sizing
    import blockmech.draw.equilibria as balancing
    import blockmech.draw.friction_solutions as rubbing
    import blockmech.draw.identify as identifying
    import blockmech.draw.linearize as linearising
    import blockmech.draw.sensitivity as sensing
    import blockmech.draw.study as studying
    import blockmech.draw.tolerance as tolerating
    import blockmech.draw.trade as trading
    import blockmech.dynamics.impact as striking
    import blockmech.dynamics.simulation as simulating
    import blockmech.dynamics.stepper as stepping
    import blockmech.studies.drives as weighing
    import blockmech.studies.family as designing
    import blockmech.studies.floquet as repeating
    import blockmech.studies.objective as optimising
    import blockmech.studies.verified as verifying


class Mechanism(Compiled):
    """A valid mechanism, compiled. Made by `Graph.compile` or `Linkage.compile`.

    >>> import blockmech as bm
    >>> mech = bm.Graph.load("graphs/ruiz_fourbar.json").compile()  # doctest: +SKIP
    >>> mech.run(at=[0.0, 1.0], want=["crank.drive"])  # doctest: +SKIP
    """

    if TYPE_CHECKING:
        available = weighing.available
        balance = sizing.balance
        equilibria = balancing.equilibria
        explain = explaining.explain
        extremes = extremal.extremes
        friction_solutions = rubbing.friction_solutions
        floquet = repeating.floquet
        flywheel = sizing.flywheel
        identify = identifying.identify
        impulses = striking.impulses
        instant_centre = instants.instant_centre
        limits = closing.limits
        linearize = linearising.linearize
        mechanical_advantage = instants.mechanical_advantage
        modes = closing.modes
        motor = sizing.motor
        objective = optimising.objective
        parameters = designing.parameters
        path_radius = instants.path_radius
        sensitivity = sensing.sensitivity
        simulate = simulating.simulate
        stepper = stepping.stepper
        stroke = stroking.stroke
        study = studying.study
        tolerance = tolerating.tolerance
        trade = trading.trade
        velocity_ratio = instants.velocity_ratio
        verify = verifying.verify
    else:
        available = LazyMethod("blockmech.studies.drives")
        balance = LazyMethod("blockmech.draw.balance")
        equilibria = LazyMethod("blockmech.draw.equilibria")
        explain = LazyMethod("blockmech.analysis.explain")
        extremes = LazyMethod("blockmech.analysis.extremes")
        friction_solutions = LazyMethod("blockmech.draw.friction_solutions")
        floquet = LazyMethod("blockmech.studies.floquet")
        flywheel = LazyMethod("blockmech.draw.balance")
        identify = LazyMethod("blockmech.draw.identify")
        impulses = LazyMethod("blockmech.dynamics.impact")
        instant_centre = LazyMethod("blockmech.analysis.instants")
        limits = LazyMethod("blockmech.draw.arcs")
        linearize = LazyMethod("blockmech.draw.linearize")
        mechanical_advantage = LazyMethod("blockmech.analysis.instants")
        modes = LazyMethod("blockmech.draw.arcs")
        motor = LazyMethod("blockmech.draw.balance")
        objective = LazyMethod("blockmech.studies.objective")
        parameters = LazyMethod("blockmech.studies.family")
        path_radius = LazyMethod("blockmech.analysis.instants")
        sensitivity = LazyMethod("blockmech.draw.sensitivity")
        simulate = LazyMethod("blockmech.dynamics.simulation")
        stepper = LazyMethod("blockmech.dynamics.stepper")
        stroke = LazyMethod("blockmech.analysis.stroke")
        study = LazyMethod("blockmech.draw.study")
        tolerance = LazyMethod("blockmech.draw.tolerance")
        trade = LazyMethod("blockmech.draw.trade")
        velocity_ratio = LazyMethod("blockmech.analysis.instants")
        verify = LazyMethod("blockmech.studies.verified")

    def _repr_svg_(self) -> str | None:
        """The mechanism over its range, or, where that is not known, with its drivers at zero."""
        from blockmech.draw import mechanism_svg

        for at in (None, dict.fromkeys(self.drivers, 0.0)):
            with suppress(BlockmechError):
                return mechanism_svg(self, at)
        return None

    def with_deflections(self, taken: Samples) -> Samples:
        """Samples with the states of friction laws; see `blockmech.analysis.deflections`."""
        from blockmech.analysis.deflections import with_deflections

        return with_deflections(self, taken)

    def run_to(self, *request: Any) -> Result:
        """Run with the settings that an accuracy needs; see `blockmech.analysis.accuracy`."""
        from blockmech.analysis.accuracy import run_to

        return run_to(self, *request)

    def digits_lost(self, result: Result) -> tuple[Flag, ...]:
        """Outputs that are rounding for the most part; see `blockmech.analysis.rounding`."""
        from blockmech.analysis.rounding import digits_lost

        return digits_lost(result)

    def simulated(self, **request: Any) -> Result:
        """A motion under the loads; see `blockmech.dynamics.simulation`."""
        return self.simulate(**request)

    def stroke_of(self, result: Result, output: str) -> stroking.Stroke:
        """The stroke of an output over a result; see `blockmech.analysis.stroke`."""
        from blockmech.analysis.stroke import stroke

        return stroke(result, output)

    def motion_svg(self, result: Result) -> str:
        """The picture of a simulation; see `blockmech.draw.simulation`."""
        from blockmech.draw.simulation import motion_svg

        return motion_svg(result)

    def feasible(self, groups: frozenset[str], held: Mapping[str, float] | None = None) -> str:
        """Where these groups close, in words for a message.

        ``held`` is driver -> coordinate [rad or m] where there are several drivers. Without
        it the answer is kept, so asking again is free.
        """
        from blockmech.analysis.limits import arcs_sentence

        if held is not None:
            return f"{arcs_sentence(self, held, groups)}, each with the others held"
        if groups not in self._kept:
            self._kept[groups] = arcs_sentence(self, {}, groups)
        return str(self._kept[groups])
