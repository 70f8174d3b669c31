"""The plan: wanted outputs become one short straight-line program.

A pass is a set of *rules*. A rule answers one question ("velocity of this
block", "load on that link") by asking other rules and emitting calls. Every
question is answered at most once, so what nobody asks for costs nothing: the
pruning is the asking. The answers are values of the program (`plan.values`).

    want ──> rules ask rules ──> Schedule: lines + kernel entries ──> Program
                                                                   (bound by an engine)

The program is readable Python; ``print(plan.program.source)`` shows what runs.
"""

from __future__ import annotations

import copy
import functools
import re
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import CodeType
from typing import Any, Literal, NamedTuple, TypeAlias, TypeVar

from blockmech.ground.errors import listed
from blockmech.ground.limits import DEEPEST
from blockmech.ground.plane import SCALAR_PRIMITIVES, within_half_turn
from blockmech.ground.runnable import LazyMethod
from blockmech.model.scene import Scene
from blockmech.model.structure import MarkerRef, Structure
from blockmech.plan.quantities import QUANTITIES
from blockmech.plan.values import NAME, NOUGHT, ONE, REST, UNIT, ZERO, Value, imul
from blockmech.typing import Kernel, Real, Record, Values

NO_LETTER = re.compile(r"\W", re.ASCII)
STAGES = ("position", "velocity", "acceleration", "unit velocity", "unit acceleration", "force")

REPORTS = ("margin", "path", "friction", "existence", "rest", "pressing", "push")

T = TypeVar("T")
NO_ANSWER: Any = object()  # that of a question which was not asked
Formula: TypeAlias = Callable[[Structure, Scene], Any]
"""What a parameter is of a design: a number or a named tuple of numbers."""

Node: TypeAlias = tuple[str, ...]
Guess: TypeAlias = "Callable[[Schedule, str], Value]"
"""What gives a group without closed form the guess of its pose."""


class Entry(NamedTuple):
    """One kernel call of the plan."""

    block: str
    stage: str  # one of STAGES
    driver: str = ""  # of the unit-rate stages: which driver moves; of a unit load: where it acts

    @property
    def node(self) -> Node:
        """The call in the graph of the plan: (block, stage), of unit rates with the driver."""
        return tuple(self) if self.driver else self[:2]


class Call(NamedTuple):
    """A call of the plan's graph as it came into the program.

    node : the call
    value : name of the value that it gives
    line : number of lines that stand before what uses it
    head : of a share in what is reduced to a driver, that driver's block, which adds them up
    """

    node: Node
    value: str
    line: int
    head: str = ""


@dataclass(frozen=True)
class Friction:
    """How the friction equations are solved: the user's trade of speed for accuracy.

    method : "none" | "single" | "successive" | "newton"
    tolerance [N] : largest change of a reaction at which ``successive`` stops; by default
        1e-7 of the largest one
    iterations : fixed number of iterations of ``successive``, or None
    along : whether the samples are those of a motion, of which the friction of each pair is known:
        an input ``friction_j`` [N m or N]. Of several solutions it is the one to give. With several
        drivers ``sticks_j`` is 1 where the pair sticks and has it whatever its load, else 0
    pushed : pairs (`JointRef`) along whose coordinates something else pushes, such as an end stop:
        ``push_j`` is an input [N m or N], on the later link
    """

    method: str = "newton"
    tolerance: float | None = None
    iterations: int | None = None
    along: bool = False
    pushed: Values = ()


class UnitLoad(NamedTuple):
    """A force of 1 N at a marker, along x or along y."""

    marker: MarkerRef
    axis: Literal["x", "y"]

    @property
    def force(self) -> Value:
        """The force in a program."""
        return ONE if self.axis == "x" else imul(ONE, UNIT)

    @property
    def name(self) -> str:
        """Where it acts, and along what."""
        return f"{self.marker}.{self.axis}"


@dataclass(frozen=True)
class Program:
    """A straight-line program: what an engine binds and runs.

    Attributes
    ----------
    source : text of ``program(inputs, P)``; returns the tuple ``outputs``
    inputs : names of the inputs, e.g. ``q_0``, ``qd_0``, ``qdd_0`` of the first driver
    angles : those inputs that are angles [rad] and keep double precision
    functions : name in the text -> the kernel (to be bound by the engine)
    formulas : name in the text -> what the parameter is of a design, in the order of ``P``
    parameters : the same of the design that was planned
    outputs : expressions returned, in this order
    calls : number of kernel calls
    """

    source: str
    inputs: tuple[str, ...]
    angles: frozenset[str]
    functions: Mapping[str, Kernel]
    formulas: Mapping[str, Formula] = field(compare=False)
    parameters: Record
    outputs: tuple[str, ...]
    calls: int = field(compare=False)

    def values(self, structure: Structure, scene: Scene) -> Values:
        """The parameters ``P`` of another design of the same structure.

        The numbers of its blocks, links and elements may be of any type with arithmetic
        (`blockmech.ground.plane`). What is zero in the planned design has no slot.
        """
        return tuple(formula(structure, scene) for formula in self.formulas.values())

    def of(self, structure: Structure, scene: Scene) -> Program:
        """The program of another mechanism of the same form."""
        values = zip(self.formulas, self.values(structure, scene), strict=True)
        functions = {  # what is no kernel knows its mechanism
            name: f.of(structure) if hasattr(f, "of") else f for name, f in self.functions.items()
        }
        return replace(self, parameters=dict(values), functions=functions)

    @cached_property
    def code(self) -> CodeType:
        """The source compiled, once for all engines and all mechanisms of one structure."""
        return _compiled(self.source)


@functools.lru_cache
def _compiled(source: str) -> CodeType:
    """A program's code: numbers are parameters, so designs of one structure share it."""
    return compile(source, "<plan>", "exec")


class Schedule:
    """A program under construction: asks, remembers, emits.

    A rule asks for what it needs before it emits, so the order of asking is a topological order
    of the kernel calls (`Plan.graph`), and the program is emitted in it.
    """

    def __init__(
        self,
        structure: Structure,
        scene: Scene,
        friction: Friction,
        static: bool = False,
        *,
        guess: Guess,
    ) -> None:
        """``guess`` serves groups without closed form; see `passes.homotopy.schedule`."""
        self.structure = structure
        self.scene = scene
        self.friction = friction
        self.static = static
        self.guess = guess
        self.entries: list[Entry] = []
        self.calls: list[Call] = []
        self.kernel_calls = 0
        self.lines: list[tuple[str, str]] = []  # name of a value and the expression for it
        self.functions: dict[str, Kernel] = {}
        self._function_names: dict[Kernel, str] = {}
        self.formulas: dict[str, Formula] = {}
        self.computed: list[Formula] = []  # by which rules decided something
        self.inputs: set[str] = set()
        self.angles: set[str] = set()
        self.unit_load: UnitLoad | None = None
        self._loaded: Schedule | None = None  # of unit loads, the schedule that `under` is of
        self._answers: dict[Hashable, Any] = {}
        self._by_text: dict[str, Value] = {}  # expression -> its name
        self._names: dict[str, int] = {}
        self._taken = {"P", *map(str, (ZERO, ONE, REST)), "t", "program", "abs", *SCALAR_PRIMITIVES}
        self._slots: dict[Hashable, Value] = {}
        self._order = {name: i for i, name in enumerate(structure.blocks)}

    def ask(self, rule: Callable[..., T], *key: Hashable) -> T:
        """The answer of a rule; worked out once."""
        question = (rule, *key)
        answer: T = self._answers.get(question, NO_ANSWER)
        if answer is NO_ANSWER:
            answer = self._answers[question] = rule(self, *key)
        return answer

    def settle(self, answer: object, rule: Callable[..., object], *key: Hashable) -> None:
        """Give the answer of a rule, in place of working it out."""
        self._answers[(rule, *key)] = answer

    def under(self, load: UnitLoad) -> Schedule:
        """The same program, asked about the mechanism at rest under a unit load alone.

        No friction acts, and drivers are held. Poses are those of this schedule, and what leans
        on one side or the other in it (teeth, chains) does so there.
        """
        schedule = copy.copy(self)
        schedule.unit_load, schedule.static, schedule.friction = load, True, Friction("none")
        schedule._answers, schedule._loaded = {}, self.loaded
        return schedule

    @property
    def loaded(self) -> Schedule:
        """The schedule of the loads that there are; see `under`."""
        return self._loaded or self

    def ask_first(
        self,
        rule: Callable[..., object],
        block: str,
        neighbours: Callable[[str], Iterable[str]],
        *key: Hashable,
    ) -> None:
        """Ask the same of everything a block waits for, nearest to the answered ones first.

        Rules call each other along the wires; this keeps that recursion one block
        deep, so a chain of a thousand groups needs no deep stack.
        """
        order = self._order
        waiting, stack = {block}, [block]
        while stack:
            for neighbour in neighbours(stack.pop()):
                if neighbour in order and neighbour not in waiting:
                    if (rule, neighbour, *key) in self._answers:
                        continue
                    waiting.add(neighbour)
                    stack.append(neighbour)
        waiting.discard(block)
        upstream = sorted(waiting, key=lambda b: order[b])
        down = bool(upstream) and order[upstream[0]] > order[block]
        for name in reversed(upstream) if down else upstream:
            self.ask(rule, name, *key)

    def emit(self, function: Kernel, *args: Value, name: str) -> Value:
        """Emit a call of a pure function; the same call twice is one line."""
        text = f"{self._function(function)}({', '.join([x.text for x in args])})"
        before = len(self.lines)
        value = self._named(text, name)
        self.kernel_calls += len(self.lines) - before
        return value

    def line(self, value: Value, name: str) -> Value:
        """Emit an expression under a name; the same twice is one line, what has a name none."""
        return value if value.rank == NAME else self._named(value.text, name)

    def _named(self, text: str, name: str) -> Value:
        value = self._by_text.get(text)
        if value is None:
            value = self._by_text[text] = self._add(text, name)
        return value

    def sum(self, terms: Iterable[Value], name: str, nothing: Value = NOUGHT) -> Value:
        """Emit a sum in the order given, without zeros; ``nothing`` is the sum of no terms."""
        nonzero = [x for x in terms if not x.zero]
        if not nonzero:
            return nothing
        total = nonzero[0]
        for start in range(1, len(nonzero), DEEPEST):
            parts = (total, *nonzero[start : start + DEEPEST])
            total = self._add(" + ".join([x.text for x in parts]), name)
        return total

    def kernel(self, entry: Entry, function: Kernel, *args: Value, name: str) -> Value:
        """Emit the call that an entry of the plan stands for."""
        before = len(self.lines)
        value = self.emit(function, *args, name=name)
        if self.unit_load is not None and len(self.lines) == before:
            return value  # a pose that is there
        self.entries.append(entry)
        self.calls.append(Call(entry.node, value.text, len(self.lines)))
        return value

    def share(self, block: str, driver: str, value: Value) -> Value:
        """Note a value as a block's share of what is reduced to a driver."""
        head = self.structure.driven[driver].block
        self.calls.append(Call((block, "reduction", driver), value.text, len(self.lines), head))
        return value

    def parameter(self, key: Hashable, formula: Formula, name: str) -> Value:
        """A parameter slot, which a formula fills for any design."""
        if key not in self._slots:
            self._slots[key] = Value(self._fresh(name))
            self.formulas[self._slots[key].text] = formula
        return self._slots[key]

    def planned(self, formula: Formula) -> Any:
        """A number of the planned design that a rule computes: what is zero there is left out."""
        self.computed.append(formula)
        return formula(self.structure, self.scene)

    def input(self, quantity: str, driver: str) -> Value:
        """An input: "q", "qd" or "qdd" of a driver."""
        name = f"{quantity}_{self.structure.drivers.index(driver)}"
        self.inputs.add(name)
        if quantity == "q" and self.structure.driver_joint(driver).rotary:
            self.angles.add(name)
        return Value(name)

    def unknown(self, name: str) -> Value:
        """An input that is neither a driver's nor the time."""
        self.inputs.add(name)
        self._taken.add(name)
        return Value(name)

    def time(self) -> Value:
        """The input "t", the time [s]."""
        self.inputs.add("t")
        return Value("t")

    def program(self, outputs: Iterable[Value]) -> Program:
        """The finished program that returns these values."""
        names = tuple(map(str, outputs))
        inputs = tuple(sorted(self.inputs))
        body = [f"    {name} = {text}" for name, text in self.lines]
        head = [f"def program({', '.join((*inputs, 'P'))}):"]
        if self.formulas:
            head.append(f"    {', '.join(self.formulas)}, = P")
        result = f"    return ({', '.join(names)}{',' if names else ''})"
        source = "\n".join([*head, *body, result]) + "\n"
        functions, formulas = dict(self.functions), dict(self.formulas)
        angles, calls = frozenset(self.angles), self.kernel_calls
        program = Program(source, inputs, angles, functions, formulas, {}, names, calls)
        return program.of(self.structure, self.scene)

    def _add(self, text: str, name: str) -> Value:
        value = self._fresh(name)
        self.lines.append((value, text))
        return Value(value)

    def _function(self, function: Kernel) -> str:
        name = self._function_names.get(function)
        if name is None:
            name = _identifier(f"{function.__module__.rsplit('.', 1)[-1]}_{function.__name__}")
            while name in self._taken:
                name += "_"
            self._taken.add(name)
            self.functions[name], self._function_names[function] = function, name
        return name

    def _fresh(self, name: str) -> str:
        base = value = _identifier(name)
        while value in self._taken:  # by a block of a like name, or by a function
            count = self._names[base] = self._names.get(base, 1) + 1
            value = f"{base}_{count}"
        self._taken.add(value)
        return value


Reader = Callable[..., Real]


class Undefined(float):
    """NaN for a number that a run does not define, with the reason in words."""

    why: str

    def __new__(cls, why: str) -> Undefined:
        number = super().__new__(cls, "nan")
        number.why = why
        return number


class Output(NamedTuple):
    """One thing that can be wanted.

    Attributes
    ----------
    name : e.g. ``"dyad.B.reaction"``
    unit : SI, ``""`` where dimensionless
    kind : "real", "vector" (complex x + iy), "matrix" (square over the drivers) or
        "number" (one per run)
    ask : the rule's answer in a schedule: values of its program
    read : arrays of those values -> the output's array
    by, on : for what one link exerts on another, the two links
    words : what it is, where its last name does not say it
    circular : whether it is an angle that is known but for whole turns, as those of links are
    """

    name: str
    unit: str
    kind: Literal["real", "vector", "matrix", "number"]
    ask: Callable[[Schedule], Iterable[Value]]
    read: Reader
    by: str = ""
    on: str = ""
    words: str = ""
    circular: bool = False

    def difference(self, x: Real, y: Real) -> Real:
        """Values less others (n,); of an angle the short way round."""
        return within_half_turn(x - y) if self.circular else x - y

    @property
    def about(self) -> str:
        """What it is, in words."""
        named = (QUANTITIES[x] for x in reversed(self.name.split(".")) if x in QUANTITIES)
        words = self.words or next(named)  # of a part of a vector its whole
        return words.format(by=self.by, on=self.on)


@functools.cache
def _identifier(name: str) -> str:
    word = NO_LETTER.sub("_", name)
    return f"_{word}" if not word or word[0].isdigit() else word


@dataclass(frozen=True, repr=False)
class Plan:
    """What is computed for a request, and the program that does it.

    Attributes
    ----------
    want : names of the wanted outputs
    entries : the kernel calls, by stage and formation order
    steps : lines of the program and the calls in them; see `graph`
    program : the straight-line program
    layout : wanted output -> indices of the program's values
    reports : kind of `REPORTS` -> block or pair -> indices of the values that judge it
    engines : (engine, precision) -> the program made ready for it, when it was first run
    """

    want: tuple[str, ...]
    entries: tuple[Entry, ...]
    steps: tuple[Sequence[tuple[str, str]], Sequence[Call]] = field(compare=False)
    program: Program
    layout: Mapping[str, tuple[int, ...]]
    reports: Mapping[str, Mapping[Any, tuple[int, ...]]]
    engines: dict[tuple[str, str], Any] = field(default_factory=dict, compare=False)

    def __repr__(self) -> str:
        return f"<Plan of {listed(self.want, 3)}: {self.calls} kernel calls a sample>"

    @cached_property
    def verdicts(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Indices of the values that judge a sample: margins, outcomes of friction."""
        margins, frictions = (self.reports[kind].values() for kind in ("margin", "friction"))
        return tuple(i[0] for i in margins), tuple(i[3] for i in frictions)

    @property
    def calls(self) -> int:
        """Number of kernel calls per sample."""
        return len(self.entries)

    def count(self, stage: str) -> int:
        """Number of kernel calls of one stage."""
        return sum(e.stage == stage for e in self.entries)

    graph = LazyMethod("blockmech.plan.calls.graph")
    explain = LazyMethod("blockmech.plan.calls.explain")
