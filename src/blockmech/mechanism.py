"""The facade: a compiled mechanism with all its analyses as methods.

It stands above every analysis and is imported by none: they take a `Compiled`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

from blockmech.compiled import EVERYTHING, Compiled
from blockmech.failures import without_gaps
from blockmech.result import Result
from blockmech.samples import make_samples

if TYPE_CHECKING:
    from blockmech.analysis.extremes import Extremes
    from blockmech.analysis.limits import Limits
    from blockmech.analysis.stroke import Stroke
    from blockmech.draw.trade import PlottedTrade
    from blockmech.modes.found import Modes


class Mechanism(Compiled):
    """A valid mechanism, compiled. Made by `Graph.compile`.

    >>> import blockmech as bm
    >>> mech = bm.Graph.load("graphs/ruiz_fourbar.json").compile()  # doctest: +SKIP
    >>> mech.run(at=[0.0, 1.0], want=["crank.drive"])  # doctest: +SKIP
    """

    def run(
        self,
        at: Any = None,
        *,
        samples: int | None = None,
        times: Any = None,
        rates: Any = None,
        accelerations: Any = None,
        want: Iterable[str] | str = EVERYTHING,
        friction: str | None = None,
        tolerance: float | None = None,
        iterations: int | None = None,
        accuracy: float | None = None,
        static: bool = False,
        engine: Literal["auto", "scalar", "numpy"] = "auto",
        precision: str | None = None,
        chunk: int | None = None,
        on_gap: Literal["raise", "mark", "stop"] = "raise",
    ) -> Result:
        """Compute the wanted outputs at given driver coordinates or times.

        Parameters
        ----------
        at : float or (n,) [rad or m], or a mapping driver -> (n,)
            Driver coordinates; rates follow from the scene's law of motion.
        samples : int
            That many equally spaced samples of the law's range; default 361.
        times : (n,) [s]
            Samples of the laws of motion by time.
        rates, accelerations : like ``at``
            Driver rates and accelerations, in place of the law's.
        want, friction, tolerance, iterations, static : see `plan`
        accuracy : float [- or rad]
            Wanted error relative to each output's largest magnitude; chooses friction
            method, iterations and precision, and ``result.accuracy`` says which.
        engine : "scalar" for few samples, "numpy" for batches, "auto" by size
        precision : "complex64" | "complex128" (default) | "clongdouble" (NumPy engine)
        chunk : samples per batch of the NumPy engine
        on_gap : what to do at samples without an answer: raise, mark them as NaN,
            or stop before the first

        Returns
        -------
        Result, labelled, with units and quality

        Raises
        ------
        RequestError for unknown names or settings that do not fit
        AssemblyError, SingularError, FrictionError at gaps, unless marked
        """
        if accuracy is not None:
            from blockmech.analysis.accuracy import refuse_settings, run_to

            taken = make_samples(self, self.scene, at, samples, times, rates, accelerations)
            given = {"friction": friction, "tolerance": tolerance, "iterations": iterations}
            refuse_settings(accuracy, **given, precision=precision)
            found = run_to(self, taken, want, accuracy, static, engine, chunk)
        else:
            found = super().run(
                at,
                samples=samples,
                times=times,
                rates=rates,
                accelerations=accelerations,
                want=want,
                friction=friction,
                tolerance=tolerance,
                iterations=iterations,
                static=static,
                engine=engine,
                precision=precision,
                chunk=chunk,
                on_gap="mark",
            )
        return without_gaps(found, on_gap, self.feasible)

    def feasible(self, groups: frozenset[str], held: Mapping[str, float] | None = None) -> str:
        """Where these groups close, in words for a message.

        ``held`` is driver -> coordinate [rad or m] where there are several drivers. Without
        it the answer is kept, so asking again is free.
        """
        from blockmech.analysis.limits import arcs_sentence

        if held is not None:
            return f"{arcs_sentence(self, held, groups)}, each with the others held"
        if groups not in self._feasible:
            self._feasible[groups] = arcs_sentence(self, {}, groups)
        return self._feasible[groups]

    @cached_property
    def _feasible(self) -> dict[frozenset[str], str]:
        return {}

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
