"""Readable assertions about a mechanism: ``assert_graph(g).has_mobility(1).balances()``.

Each raises `AssertionError` with a sentence that says what was expected and what was
found, and gives itself back, so that they chain. A question that makes no sense (an
output that there is not) is a `RequestError`, as everywhere.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from blockmech.builders import Opened, opened, problems_in
from blockmech.ground.arguments import declared
from blockmech.ground.errors import Problem, RequestError, refused
from blockmech.testing.expectations import as_numbers, compared, failure_table, misfits

if TYPE_CHECKING:
    from blockmech.analysis.limits import Limits
    from blockmech.mechanism import Mechanism

ROUNDING = 8 * float(np.finfo(float).eps)
"""Relative, of a driver coordinate: ends of arcs are found to rounding."""


@declared
def assert_graph(graph: Opened | str | os.PathLike[str]) -> GraphAssertion:
    """Start a chain of assertions about a graph, links and joints, or a file of either.

    >>> import blockmech as bm
    >>> g = bm.Graph("crank alone")
    >>> g.add("frame", bm.Frame(markers={"A": (0, 0)}))
    >>> g.add("crank", bm.Crank(length=2.0))
    >>> g.connect("frame.A", "crank.A")
    >>> assert_graph(g).is_formation_sequence("crank").has_mobility(1)
    <assertions about crank alone>
    """
    return GraphAssertion(graph)


class GraphAssertion:
    """A chain of assertions about one mechanism; made by `assert_graph`."""

    def __init__(self, graph: Opened | str | os.PathLike[str]) -> None:
        self._given = graph

    @property
    def _name(self) -> str:
        return self._given.name if isinstance(self._given, Opened) else os.fspath(self._given)

    @cached_property
    def _problems(self) -> list[Problem]:
        return self._given.check() if isinstance(self._given, Opened) else problems_in(self._given)

    @cached_property
    def _mechanism(self) -> Mechanism:
        __tracebackhide__ = True
        if self._problems:
            self._fail("a valid mechanism", _lines(self._problems))
        graph = self._given if isinstance(self._given, Opened) else opened(self._given)
        return graph.compile()

    def _fail(self, expected: str, actual: str) -> NoReturn:
        __tracebackhide__ = True
        raise AssertionError(f"{self._name}: expected {expected}, found {actual}")

    # -- structure ---------------------------------------------------------------------------

    @declared
    def is_formation_sequence(self, *blocks: str) -> GraphAssertion:
        """The graph is valid, and, if blocks are named, forms in that order (ties by name)."""
        __tracebackhide__ = True
        order = tuple(self._mechanism.structure.blocks)
        if blocks and order != blocks:
            self._fail(f"the formation sequence {_arrows(blocks)}", _arrows(order))
        return self

    @declared
    def has_mobility(self, mobility: int) -> GraphAssertion:
        """The Chebyshev-Gruebler mobility 3n - 2p is that number."""
        __tracebackhide__ = True
        s = self._mechanism.structure
        if s.mobility != mobility:
            counts = f"{len(s.links) - 1} moving links, {s.pairs} pairs"
            self._fail(f"mobility {mobility}", f"{s.mobility} ({counts})")
        return self

    def fails_with(self, code: str, where: str | None = None) -> GraphAssertion:
        """The check of the graph or file names a problem with that code (at that address)."""
        __tracebackhide__ = True
        if not any(p.code == code and where in (None, p.where) for p in self._problems):
            address = f" at {where}" if where is not None else ""
            valid = "no problem: the mechanism is valid"
            self._fail(
                f'the problem "{code}"{address}',
                _lines(self._problems) if self._problems else valid,
            )
        return self

    def schedules(
        self, want: str | Iterable[str], *calls: tuple[str, ...], **settings: Any
    ) -> GraphAssertion:
        """These outputs take exactly these kernel calls, named in an order that works.

        Parameters
        ----------
        want : names or patterns of outputs
        calls : (block, stage), of stages at unit rate (block, stage, driver); see `Plan.graph`
        settings : friction, static ... as for `Mechanism.plan`
        """
        __tracebackhide__ = True
        graph = self._mechanism.plan(want, **settings).graph()
        computed = [call for call in graph if call[1] != "reduction"]
        if set(computed) != set(calls):
            self._fail(f"the calls {_calls(calls)}", _calls(computed))
        for first, then in graph.subgraph(computed).edges:
            if calls.index(first) > calls.index(then):
                self._fail(
                    f"the order {_calls(calls)}", f"{_calls([then])} needs {_calls([first])}"
                )
        return self

    # -- motion ------------------------------------------------------------------------------

    @declared
    def closes_on(
        self, driver: str, start: float, end: float, at: Mapping[str, float] | None = None
    ) -> GraphAssertion:
        """Every group closes while the driver goes from start to end [rad or m].

        Found from the feasible arcs of the driver, not from samples. ``at`` says where
        other drivers stand, by default where their laws of motion begin.
        """
        __tracebackhide__ = True
        from blockmech.analysis.limits import limits

        closure = limits(self._mechanism, driver, at)
        if not _holds(closure, start, end):
            stretch = f"from {start:.9g} to {end:.9g} {closure.unit}"
            name = self._mechanism._of_driver(driver, "q")
            self._fail(f"every group to close on {name} {stretch}", str(closure))
        return self

    # -- numbers -----------------------------------------------------------------------------

    def balances(self, **request: Any) -> GraphAssertion:
        """Forces, moments and powers balance; ``request`` as for `Mechanism.verify`."""
        __tracebackhide__ = True
        report = self._mechanism.verify(**request)
        if report.samples == 0:
            self._fail("balances", "no sample with an answer to balance")
        wrong = [r for r in report.rows if not r.ok]
        if wrong:
            rows = (f"  {r.name}: {r.value:.3g} where {r.allowed:.3g} is allowed" for r in wrong)
            self._fail(
                f"all {len(report.rows)} balances to hold",
                "\n".join([f"{len(wrong)} that do not (relative error [-])", *rows]),
            )
        return self

    def has_output(
        self,
        name: str,
        *,
        value: Any,
        rtol: float | None = None,
        atol: float | None = None,
        **request: Any,
    ) -> GraphAssertion:
        """An output has these values within a tolerance.

        Parameters
        ----------
        name : one output, e.g. "dyad.j.omega"
        value : number, or complex or [x, y] for a vector; one, or one a sample
        rtol, atol : relative [-] and absolute [unit of the output] tolerance; at least
            one. A value is met within the larger of ``atol`` and ``rtol`` times its size.
        request : samples and settings as for `Mechanism.run` (at, times, friction ...)

        Raises `RequestError` for what cannot be asked, `AssertionError` for other values.
        """
        __tracebackhide__ = True
        if not {"at", "times", "samples"} & set(request):
            raise refused("has_output", "no samples are named", "give at=, times= or samples=")
        if rtol is None and atol is None:
            raise refused("has_output", "no tolerance is given", "give rtol=, atol= or both")
        result = self._mechanism.run(want=[name], **{**request, "on_gap": "mark"})
        if name not in result:
            raise refused("has_output", f"{name} is a pattern", "name one output")
        values = _listed(value, self._mechanism.outputs[name].kind)
        RequestError.raise_for(misfits(self._mechanism, name, values, result.n))
        outcomes = list(compared(result, name, as_numbers(values), rtol or 0.0, atol or 0.0))
        if not all(o.ok for o in outcomes):
            failed = sum(not o.ok for o in outcomes)
            count = f"{failed} of {len(outcomes)} not met:" if len(outcomes) > 1 else "it not met:"
            self._fail(f"{name} within its tolerance", f"{count}\n{failure_table(outcomes)}")
        return self

    def __repr__(self) -> str:
        return f"<assertions about {self._name}>"


def _listed(value: Any, kind: str) -> list[Any]:
    """One value or several as a list of numbers, or of [x, y]."""
    numbers = np.atleast_1d(np.asarray(value))
    if np.iscomplexobj(numbers):
        numbers = np.stack([numbers.real, numbers.imag], axis=-1)
    elif kind == "vector" and numbers.shape == (2,):
        numbers = numbers[None]
    is_finite = numbers.dtype.kind in "iuf" and bool(np.isfinite(numbers).all())
    if not is_finite or numbers.shape[1:] not in ((), (2,)):
        remedy = "give finite numbers, of a vector complex or [x, y]"
        raise refused("has_output", f"value is {value!r}", remedy)
    values: list[Any] = numbers.tolist()
    return values


def _holds(limits: Limits, start: float, end: float) -> bool:
    """Whether one feasible arc holds all from start to end, of an angle on whatever turn."""
    if limits.whole_turn:
        return True
    slack = ROUNDING * max(1.0 if limits.unit == "rad" else 0.0, abs(start), abs(end))
    for arc in limits.arcs:
        turns = 0.0
        if limits.unit == "rad" and math.isfinite(arc.length):
            apart = (start + end - arc.start.q - arc.end.q) / 2
            turns = apart - math.remainder(apart, 2 * math.pi)
        low, high = sorted((start - turns, end - turns))
        if arc.start.q - slack <= low and high <= arc.end.q + slack:
            return True
    return False


def _lines(problems: Iterable[Problem]) -> str:
    lines = [str(p) for p in problems]
    return lines[0] if len(lines) == 1 else "\n".join([f"{len(lines)} problems:", *lines])


def _arrows(blocks: Iterable[str]) -> str:
    return " -> ".join(blocks)


def _calls(calls: Iterable[tuple[str, ...]]) -> str:
    return ", ".join(" ".join(call) for call in calls) or "none"
