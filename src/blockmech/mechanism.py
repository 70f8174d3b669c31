"""The facade: a compiled mechanism with all its analyses as methods.

It stands above every analysis and is imported by none: they take a `Compiled`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from blockmech.compiled import EVERYTHING, Compiled
from blockmech.result import Result

if TYPE_CHECKING:
    from blockmech.analysis.extremes import Extremes
    from blockmech.analysis.limits import Limits
    from blockmech.analysis.stroke import Stroke
    from blockmech.draw.study import PlottedStudy
    from blockmech.draw.trade import PlottedTrade
    from blockmech.modes.found import Modes
    from blockmech.studies.family import Parameters


class Mechanism(Compiled):
    """A valid mechanism, compiled. Made by `Graph.compile`.

    >>> import blockmech as bm
    >>> mech = bm.Graph.load("graphs/ruiz_fourbar.json").compile()  # doctest: +SKIP
    >>> mech.run(at=[0.0, 1.0], want=["crank.drive"])  # doctest: +SKIP
    """

    def run_to(self, *request: Any) -> Result:
        """Run with the settings that an accuracy needs; see `blockmech.analysis.accuracy`."""
        from blockmech.analysis.accuracy import run_to

        return run_to(self, *request)

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

    def explain(self, want: Iterable[str] | str = EVERYTHING, **settings: Any) -> str:
        """The schedule for some outputs as text: kernel calls, and what each output costs."""
        from blockmech.analysis.explain import explain

        return explain(self, want, **settings)

    def verify(self, **request: Any) -> Any:
        """Check the mechanism against itself; see `blockmech.analysis.verify`."""
        from blockmech.analysis.verify import verify

        return verify(self, **request)

    def simulate(self, until: Any = None, **request: Any) -> Result:
        """Move under the scene's loads; see `blockmech.dynamics.simulation.simulate`."""
        from blockmech.dynamics.simulation import simulate

        return simulate(self, until, **request)

    def trade(self, question: Any = "run", want: Any = None, **request: Any) -> PlottedTrade:
        """Measure speed against accuracy; see `blockmech.analysis.trade.trade`."""
        from blockmech.analysis.trade import trade
        from blockmech.draw.trade import PlottedTrade

        return PlottedTrade(**vars(trade(self, question, want, **request)))

    def parameters(self) -> Parameters:
        """Every number of the graph or linkage: address, value, unit."""
        from blockmech.studies.family import parameters

        return parameters(self)

    def study(self, vary: Mapping[str, Any], *, want: Any, **request: Any) -> PlottedStudy:
        """Run many designs at once; see `blockmech.studies.study.study`."""
        from blockmech.draw.study import PlottedStudy
        from blockmech.studies.study import study

        return PlottedStudy(**vars(study(self, vary, want=want, **request)))

    def limits(self, driver: str | None = None, at: Any = None, **more: Any) -> Limits:
        """Feasible arcs of a driver; see `blockmech.analysis.limits.limits`."""
        from blockmech.analysis.limits import limits

        return limits(self, driver, at, **more)

    def modes(self, at: Any = None, **more: Any) -> Modes:
        """All assembly modes of every group; see `blockmech.modes.listing.modes`."""
        from blockmech.modes.listing import modes

        return modes(self, at, **more)

    def extremes(self, name: str, **request: Any) -> Extremes:
        """Extremes of an output over the cycle; see `blockmech.analysis.extremes.extremes`."""
        from blockmech.analysis.extremes import extremes

        return extremes(self, name, **request)

    def stroke(self, name: str, **request: Any) -> Stroke:
        """Stroke of a marker or an output; see `blockmech.analysis.stroke.stroke`."""
        from blockmech.analysis.stroke import stroke

        return stroke(self, name, **request)
