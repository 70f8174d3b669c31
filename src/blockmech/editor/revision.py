"""A state of the sheet, the motion that it shows, and what the page asks of it.

Questions are plain data, and so are answers: texts, pictures as SVG, rows of numbers. Those that
take long are worked out in a process of their own (`blockmech.editor.jobs`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import networkx as nx

from blockmech.builders import Graph, Opened
from blockmech.compiled import Compiled
from blockmech.draw.boxes import graph_of
from blockmech.draw.motion import Motion
from blockmech.editor.edits import without
from blockmech.editor.turn import fault_of, turn
from blockmech.figures.paper import rendered
from blockmech.ground.errors import BlockmechError, GraphError, Problem, refused
from blockmech.mechanism import Mechanism
from blockmech.model.graph import Graph as Blocks
from blockmech.result.result import Result
from blockmech.typing import Data, Record

NOTHING = "nothing moves on this sheet yet"


class Step(NamedTuple):
    """A state of the sheet, and what was done to get there."""

    form: Data
    said: str


class Revision:
    """A document as it stands between two changes; what follows from it is found once.

    Attributes
    ----------
    number : which of the sheet's states it is; none comes twice
    form : what stands in the file, as plain data; as `Graph.to_data` writes it
    document : the `Graph` or `Linkage` of the form, complete or not
    """

    def __init__(self, number: int, form: Data, document: Opened) -> None:
        self.number, self.form, self.document = number, form, document
        self._latest: tuple[Any, tuple[Motion | None, str]] | None = None

    @cached_property
    def _compiled(self) -> tuple[tuple[Problem, ...], Compiled | None, str]:
        document = self.document
        try:
            if isinstance(document, Graph):
                mechanism: Compiled = document.compile()
                return (), mechanism, mechanism.structure.formula
            decomposition = document.decompose()
            return (), decomposition.compile(), str(decomposition.formation)
        except GraphError as error:
            return error.problems, None, ""

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Everything that keeps the document from being a mechanism."""
        return self._compiled[0]

    @property
    def mechanism(self) -> Compiled | None:
        """The document compiled, None where it has problems."""
        return self._compiled[1]

    @property
    def formation(self) -> str:
        """Its drivers and groups in formation order, "" where it is no mechanism."""
        return self._compiled[2]

    @property
    def empty(self) -> bool:
        """Whether nothing is drawn yet: then a first step is said, and no problem."""
        return not (self.form.get("blocks") or self.form.get("links") or self.form.get("view"))

    @property
    def blocks(self) -> Blocks:
        """The document's blocks; of links and joints those that they become, or none."""
        if isinstance(self.document, Graph):
            return self.document
        return graph_of(self.mechanism._of_blocks) if self.mechanism else Graph()

    def shown_motion(
        self, moved: str = "", at: Mapping[str, float] | None = None
    ) -> tuple[Motion | None, str]:
        """The `turn` of the mechanism, or of the part of it that closes; and what is wrong."""
        question = moved, dict(at or {})
        if self._latest is None or self._latest[0] != question:
            self._latest = question, self._motion(moved, at)
        return self._latest[1]

    def _motion(self, moved: str, at: Mapping[str, float] | None) -> tuple[Motion | None, str]:
        form, file, mechanism = self.form, self.document.file, self.mechanism
        message, blamed = " ".join(map(str, self.problems)), blamed_blocks(form, self.problems)
        if mechanism is None:
            mechanism = what_moves(form, blamed, file)
        try:
            while mechanism is not None:
                motion = turn(mechanism, moved, at)
                if motion.feasible.any():
                    return motion, message
                message = message or fault_of(motion)
                blamed |= set(motion.quality.blame.values())
                mechanism = what_moves(form, blamed, file)
        except BlockmechError as error:  # as of a law that cannot be followed
            return None, str(error)
        return None, message


def part_of(form: Record, failing: Collection[str]) -> Data:
    """A graph's form without some blocks, and without all that hangs on them."""
    wires = ((wire["from"].split(".")[0], wire["to"].split(".")[0]) for wire in form["wires"])
    after = nx.DiGraph(wires)
    gone = {*failing}.union(*(nx.descendants(after, name) for name in failing if name in after))
    return without({key: x for key, x in form.items() if key not in ("expect", "view")}, gone)


def blamed_blocks(form: Record, problems: Iterable[Problem]) -> set[str]:
    """The blocks that problems are about."""
    names = {word for p in problems for word in re.split(r", |[.\[]", p.where)}
    return names & set(form.get("blocks", ()))


def what_moves(form: Record, failing: Iterable[str], file: str = "") -> Mechanism | None:
    """The largest part of a graph without the failing blocks that is a mechanism, or None."""
    gone = set(failing)
    while gone and form.get("blocks"):
        form = part_of(form, gone)
        try:
            graph = Graph.from_data(form, (), file)
            if not (problems := graph.check()):
                return graph.compile()
        except BlockmechError as error:
            problems = list(error.problems)
        gone = blamed_blocks(form, problems)
    return None


@dataclass(frozen=True)
class Question:
    """What is asked of a revision of a sheet.

    Of ``data`` here: ``names`` are chosen outputs, ``held`` where drivers were put by hand,
    ``moved`` which of them moves, ``pose`` the shown one of the samples, ``share`` in percent.
    """

    now: Revision
    data: Record
    report: Callable[..., None] = lambda *_: None
    computed: Motion | None = None

    @property
    def friction(self) -> Any:
        """How friction is solved."""
        return str(self.data.get("friction") or "newton")

    @property
    def share(self) -> float:
        """By which numbers are changed, or scatter."""
        return float(self.data.get("share", 10.0)) / 100

    @property
    def display(self) -> tuple[str, ...]:
        """Units in which pictures are shown; angles are in degrees by default."""
        return ("rad",) * ("|rad|" in f"|{self.data.get('units', '')}|")

    @cached_property
    def outcome(self) -> tuple[Motion | None, str]:
        """The motion that is shown, None where nothing moves; and what is wrong."""
        if self.computed is not None:
            return self.computed, ""
        at = {str(driver): float(q) for driver, q in (self.data.get("held") or {}).items()}
        return self.now.shown_motion(str(self.data.get("moved", "")), at)

    @property
    def motion(self) -> Motion:
        """The motion that is shown. Raises `RequestError` where nothing moves."""
        motion, message = self.outcome
        if motion is None:
            raise refused("mechanism", message or NOTHING, "draw what moves first")
        return motion

    @property
    def mechanism(self) -> Any:
        """What moves."""
        return self.motion.mechanism

    @property
    def names(self) -> list[str]:
        """The chosen outputs, of those that it has."""
        return [name for name in self.data.get("names", ()) if name in self.mechanism.outputs]

    @property
    def first(self) -> str:
        """The first of the chosen outputs. Raises `RequestError` for none."""
        if not self.names:
            raise refused("outputs", "none is chosen under Curves", "choose one there")
        return self.names[0]

    @property
    def sample(self) -> int:
        """The shown pose."""
        return int(self.data.get("pose", 0))

    @property
    def pose(self) -> dict[str, float]:
        """Where the drivers are in the shown pose."""
        return {driver: float(q[self.sample]) for driver, q in self.motion.q.items()}

    @property
    def rows(self) -> Record | None:
        """The poses that are shown, where the drivers' laws do not say which."""
        q = self.motion.q
        return None if {*q} <= {*self.mechanism.scene.drive} else q

    def result(self, names: Iterable[str]) -> Result:
        """Outputs at the samples of the motion; gaps are marked.

        With an ``accuracy`` the method is chosen by it. Raises `RequestError` for what cannot be.
        """
        result, accuracy = self.motion.result, self.data.get("accuracy")
        if not accuracy or result.motion is not None:
            return result.rerun(*names, friction=self.friction)
        m: Any = result.mechanism
        run = m._run_to(float(accuracy), {}, result.samples, tuple(names), False, "auto", None)
        computed: Result = run
        return computed


def svg(figure: Any) -> str:
    """A figure as text."""
    return rendered(figure, ".svg").decode()
