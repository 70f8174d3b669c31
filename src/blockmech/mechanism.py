"""The facade: a compiled mechanism with all its analyses as methods.

It stands above every analysis and is imported by none: they take a `Compiled`. Each method
is the function of that name, so its arguments are declared there and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from blockmech.compiled import Compiled
from blockmech.ground.errors import BlockmechError
from blockmech.ground.runnable import LazyMethod

if TYPE_CHECKING:
    import blockmech.analysis.equilibria
    import blockmech.analysis.explain
    import blockmech.analysis.extremes
    import blockmech.analysis.friction_solutions
    import blockmech.analysis.instant_centres
    import blockmech.analysis.limits
    import blockmech.analysis.stroke
    import blockmech.analysis.trade
    import blockmech.design.linearize
    import blockmech.design.solve
    import blockmech.draw
    import blockmech.dynamics.impact
    import blockmech.dynamics.simulation
    import blockmech.dynamics.stepper
    import blockmech.modes.listing
    import blockmech.studies.differentiate
    import blockmech.studies.enclose
    import blockmech.studies.family
    import blockmech.studies.function
    import blockmech.studies.objective
    import blockmech.studies.study
    import blockmech.studies.tolerance
    import blockmech.studies.verify
else:
    blockmech = LazyMethod("blockmech")


class Mechanism(Compiled["Mechanism"]):
    """A valid mechanism, compiled. Made by `Graph.compile` or `Linkage.compile`.

    >>> mech = bm.read("graphs/ruiz_fourbar.json").compile()
    >>> mech.run(at=["10deg", "20deg"], want="crank.drive")["crank.drive"].round(1)
    array([2850.6, 8914.3])
    """

    draw = blockmech.draw.draw
    enclose = blockmech.studies.enclose.enclose
    equilibria = blockmech.analysis.equilibria.equilibria
    explain = blockmech.analysis.explain.explain
    extremes = blockmech.analysis.extremes.extremes
    friction_solutions = blockmech.analysis.friction_solutions.friction_solutions
    function = blockmech.studies.function.function
    impulses = blockmech.dynamics.impact.impulses
    instant_centre = blockmech.analysis.instant_centres.instant_centre
    limits = blockmech.analysis.limits.limits
    linearize = blockmech.design.linearize.linearize
    mechanical_advantage = blockmech.analysis.instant_centres.mechanical_advantage
    modes = blockmech.modes.listing.modes
    objective = blockmech.studies.objective.objective
    parameters = blockmech.studies.family.parameters
    path_radius = blockmech.analysis.instant_centres.path_radius
    rates = blockmech.studies.function.rates
    sensitivity = blockmech.studies.differentiate.sensitivity
    simulate = blockmech.dynamics.simulation.simulate
    solve = blockmech.design.solve.solve
    stepper = blockmech.dynamics.stepper.stepper
    stroke = blockmech.analysis.stroke.stroke
    study = blockmech.studies.study.study
    tolerance = blockmech.studies.tolerance.tolerance
    trade = blockmech.analysis.trade.trade
    velocity_ratio = blockmech.analysis.instant_centres.velocity_ratio
    verify = blockmech.studies.verify.verify
    _homes = {
        "document.{}": "blockmech.model.document.Document",
        "structure.{}": "blockmech.model.structure.Structure",
        "run().{}": "blockmech.result.result.Result",
    }

    def _repr_svg_(self) -> str | None:
        """The mechanism over its range, or, where that is not known, as it starts; else nothing."""
        from blockmech.draw import svg

        with suppress(BlockmechError):
            return svg(self.draw())
        return None

    def _feasible(self, groups: frozenset[str], fixed: Mapping[str, float] | None = None) -> str:
        """Where these groups close, in words for a message.

        ``fixed`` is driver -> coordinate [rad or m] of the other drivers, where there are any.
        Without it the answer is kept, so asking again is free.
        """
        from blockmech.analysis.limits import arcs_sentence

        if fixed is not None:
            return f"{arcs_sentence(self, fixed, groups)}, each with the others held"
        if groups not in self._cache:
            self._cache[groups] = arcs_sentence(self, {}, groups)
        return str(self._cache[groups])
