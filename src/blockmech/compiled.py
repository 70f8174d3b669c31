"""A compiled mechanism: asks for outputs, gets results. What every analysis takes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal, Self

from blockmech.evaluator import EVERYTHING, Evaluator
from blockmech.failures import without_gaps
from blockmech.model.graph import Graph
from blockmech.model.joints.linkage import Linkage
from blockmech.model.naming import Names
from blockmech.result import Result
from blockmech.samples import make_samples


class Compiled(Evaluator):
    """A valid mechanism, compiled."""

    @classmethod
    def of(cls, document: Graph | Linkage, names: Names | None = None) -> Self:
        """A snapshot of blocks or of links and joints, checked.

        With ``names`` it speaks of the document that a graph was made of. Raises
        `GraphError` with all problems.
        """
        from blockmech.passes.following import refuse_open_homes

        if isinstance(document, Linkage):
            from blockmech.model.joints.decompose import decompose

            found = decompose(document)
            graph, names = found.graph, found.names
        else:
            graph = document
        structure = graph.structure()
        refuse_open_homes(structure)
        return cls(structure, graph.scene, graph.name, names)

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
        static: bool = False,
        engine: Literal["auto", "scalar", "numpy"] = "auto",
        precision: str | None = None,
        chunk: int | None = None,
        on_gap: Literal["raise", "mark", "stop"] = "raise",
    ) -> Result:
        """Compute the wanted outputs; the parameters are those of `Mechanism.run`."""
        taken = make_samples(self, self.scene, at, samples, times, rates, accelerations)
        friction = friction or "newton"
        plan = self.plan(
            want, friction=friction, tolerance=tolerance, iterations=iterations, static=static
        )
        values, name = self.evaluate(plan, taken, engine, precision or "complex128", chunk)
        settings = {
            "friction": friction,
            "tolerance": tolerance,
            "iterations": iterations,
            "static": static,
        }
        result = Result(self, plan, taken, values, name, settings)
        return without_gaps(result, on_gap)
