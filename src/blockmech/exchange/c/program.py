"""A plan as three C files: header, source, and a program that tests them with known answers.

    NAME.h         parameters, inputs and outputs as structs with names; how to compile
    NAME.c         the function, and the parameters of the mechanism that was planned
    NAME_test.c    poses of the mechanism's range with the numbers that blockmech has for them

No heap, no state: ``NAME(&parameters, &inputs, &outputs)`` depends on its arguments alone and may
run on any number of threads. It returns 0, or the number of the reason why there is no answer.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

import blockmech
from blockmech.analysis.deflections import refuse_deflections
from blockmech.compiled import Compiled
from blockmech.engines.nodes import Untraceable
from blockmech.engines.numpy import Planar, leaves
from blockmech.exchange.c.statements import DOUBLE, FLOAT, Statements, language_c, literal
from blockmech.exchange.c.tracing import ClosedTrace, status
from blockmech.exchange.formats import Order, Writer
from blockmech.ground.errors import BlockmechError, among, as_names, listed, printable, refused
from blockmech.ground.files import refuse_spared, writing
from blockmech.ground.limits import CHECKED
from blockmech.ground.names import numbered_name
from blockmech.ground.plane import EPS
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.structure import JointRef
from blockmech.passes.signals import STATE
from blockmech.plan.plan import Output, Plan
from blockmech.plan.settings import friction_asked
from blockmech.result.quality import WORDS
from blockmech.result.samples import Samples
from blockmech.typing import Array, Nested, Real, Record

Part: TypeAlias = Literal["real", "imag"] | tuple[int, ...]
"""A component of a vector, or indices of drivers in a matrix."""
INPUTS = {"q": ("q", ""), "qd": ("rate", "/s"), "qdd": ("acceleration", "/s2")}
FLAGS = "-std=c99 -O2 -Wall -Wextra -ffp-contract=off"
RESERVED = {
    *("auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else"),
    *("enum", "extern", "float", "for", "goto", "if", "inline", "int", "long", "main", "piece"),
    *("real", "register", "restrict", "return", "short", "signed", "sizeof", "spread"),
    *("static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while"),
}
LIBRARY = {
    *("abort", "abs", "accept", "access", "advance", "alarm", "bind", "ceil", "clock", "clone"),
    *("close", "connect", "daemon", "div", "error", "exit", "exp", "floor", "fork", "free"),
    *("gamma", "index", "kill", "link", "listen", "log", "mount", "nice", "open", "pause", "pipe"),
    *("poll", "pow", "puts", "raise", "random", "read", "reboot", "remainder", "remove", "rename"),
    *("rewind", "round", "scalb", "select", "send", "setup", "shutdown", "signal", "sin", "sleep"),
    *("socket", "splice", "sqrt", "step", "sync", "system", "tan", "tee", "time", "truncate"),
    *("wait", "warn", "write"),
}
"""Words that name functions of a C library, which would be called in place of a mechanism's."""
TOLERANCES = {DOUBLE: 1e-12, FLOAT: 1e-3}  # of the largest number of a unit, in the test


@dataclass(frozen=True)
class Member:
    """A member of a struct: name, what the comment beside it says, and its numbers."""

    name: str
    comment: str
    numbers: tuple[float, ...] = ()
    is_array: bool = False

    @property
    def declared(self) -> str:
        """As a line of a struct."""
        size = f"[{len(self.numbers)}]" if self.is_array else ""
        return f"    real {self.name}{size};{f' /* {self.comment} */' if self.comment else ''}"


class CProgram:
    """The C text of some outputs of a mechanism.

    Attributes
    ----------
    name : of the function, a C identifier
    parameters, inputs, outputs : members of the three structs
    left_out : outputs that were asked for and are numbers of a whole run
    """

    def __init__(
        self,
        mechanism: Compiled,
        want: Iterable[str] | str = EVERYTHING,
        real: str = DOUBLE,
        rates: Iterable[Output] | None = None,
        **settings: Any,
    ) -> None:
        """``rates`` are outputs beside the catalogue's that move states, which are inputs then;
        ``settings`` are those of `Compiled.plan`: friction, static.

        Raises `RequestError` for what C cannot say, e.g. a law that is a Python function, and
        without ``rates`` for what follows states.
        """
        among(TOLERANCES, "precision", real, where="real")
        self.catalogue = catalogue = mechanism.outputs.extended(rates or ())
        names = catalogue.match([*as_names("want", want), *(output.name for output in rates or ())])
        of_runs = [n for n in names if catalogue[n].kind == "number"]
        self.left_out = tuple(of_runs)
        names = tuple(n for n in names if n not in of_runs)
        if not names:
            message = f"{listed(of_runs)}: a figure of a whole run, not of a pose"
            raise refused("want", message, "want an output that every pose has")
        self.mechanism, self.real = mechanism, real
        self.name = function_name(mechanism.name.lower())
        friction, static = friction_asked(settings.get("friction")), bool(settings.get("static"))
        self.plan: Plan = catalogue.plan(mechanism.scene, names, friction, static)
        self._settings = settings
        if rates is None:
            mechanism._refuse_states(self.plan, ())
            refuse_deflections(mechanism, self.plan, "C text")
        eps = EPS if real == DOUBLE else float(np.finfo(np.float32).eps)
        try:
            self._trace = ClosedTrace(self.plan.program, eps)
            self._values = self._trace.values
            columns = list(self._columns(names))
            self._results = {column: x for column, _, _, x in columns}
            self._parts = {column: (output, part) for column, output, part, _ in columns}
            self._status = status(
                self.plan, self._values, self._finite_numbers(names), self._blocks
            )
        except Untraceable as why:
            message = f"{mechanism.name} is no C text: {why}"
            raise refused("--to c", message, "leave the outputs that need it out") from None
        self.parameters = tuple(_members(self.plan.program.parameters))
        names_in_c = Names()
        self.inputs = tuple(self._input(x, names_in_c) for x in self.plan.program.inputs)
        texts = {n: _comment(f"{n} [{self.unit_of(n) or '-'}]") for n in self._results}
        names_in_c = Names()
        self.outputs = {n: Member(names_in_c.fresh(n), texts[n]) for n in self._results}

    @property
    def states(self) -> dict[str, JointRef]:
        """Inputs that are states of signal blocks and of friction laws, with what they are of."""
        refs = list(self.mechanism.structure.states)
        inputs = self.plan.program.inputs
        return {x: refs[int(x[len(STATE) :])] for x in inputs if x.startswith(STATE)}

    @property
    def _blocks(self) -> Mapping[str, frozenset[str]]:
        structure = self.mechanism.structure
        prismatic = frozenset(
            name
            for name, b in structure.blocks.items()
            if any(b.joints[j].kind == "P" for j in b.friction)
        )
        return {"prismatic": prismatic, "following": frozenset(structure.followed)}

    def unit_of(self, column: str) -> str:
        """The unit of an output."""
        return self.catalogue[self._parts[column][0]].unit

    def _columns(self, names: tuple[str, ...]) -> Iterator[tuple[str, str, Part, Real]]:
        """Each real number: its name, its output, part of that, and what it is in the trace."""
        drivers = self.mechanism.drivers
        for name in names:
            output = self.catalogue[name]
            columns = [self._values[i] for i in self.plan.layout[name]]
            if output.kind == "matrix":
                rank = 2 if len(columns) == len(drivers) ** 2 else 1
                for part, x in zip(np.ndindex((len(drivers),) * rank), columns, strict=True):
                    yield ".".join((name, *(drivers[i] for i in part))), name, part, x
                continue
            with np.errstate(all="ignore"):
                value = output.read(*columns)
            if isinstance(value, complex | Planar):
                yield f"{name}.x", name, "real", value.real
                yield f"{name}.y", name, "imag", value.imag
            else:
                yield name, name, (), value

    def _finite_numbers(self, names: tuple[str, ...]) -> list[Real]:
        """The numbers that must be finite, as `Result` has it."""
        finite = [n for n in names if not n.endswith("mechanical_advantage")]
        indices = dict.fromkeys(i for n in finite for i in self.plan.layout[n])
        return [x for i in indices for x in leaves(self._values[i])]

    def _input(self, name: str, names: Names) -> Member:
        if name == "t":
            return Member(names.fresh("time"), "[s]")
        if name in self.states:
            block, of = self.states[name]
            signal = self.mechanism.structure.signals.get(block)
            description = "a state of" if signal else "the deflection of"
            return Member(
                names.fresh(f"{block}_{of}"), f"{description} {_comment(f'{block}.{of}')}"
            )
        quantity, _, i = name.rpartition("_")
        driver = self.mechanism.drivers[int(i)]
        word, per = INPUTS[quantity]
        unit = f"{self.mechanism.structure.driver_joint(driver).coordinate_unit}{per}"
        return Member(names.fresh(f"{driver}_{word}"), f"[{unit}]")

    # -- text ---------------------------------------------------------------------------

    @cached_property
    def _statements(self) -> tuple[Statements, str]:
        expressions: list[str] = []
        tables: dict[int, str] = {}
        for member in self.parameters:
            if member.is_array:
                tables[len(expressions)] = f"p->{member.name}"
                expressions += [f"p->{member.name}[{i}]" for i in range(len(member.numbers))]
            else:
                expressions.append(f"p->{member.name}")
        for k, table in enumerate(self._trace.tables):
            tables[len(expressions)] = f"table{k}"
            expressions += [f"table{k}[{i}]" for i in range(len(table))]
        inputs = [f"in->{member.name}" for member in self.inputs]
        statements = Statements(inputs, expressions, tables, language_c(self.real))
        return statements, statements.text([*self._results.values(), self._status])

    @property
    def header(self) -> str:
        """Text of ``NAME.h``."""
        title = getattr(self.mechanism.document, "title", "") or self.mechanism.name
        settings = (
            ", ".join(f"{k} {v}" for k, v in self._settings.items() if v) or "friction newton"
        )
        omitted = f"   Left out, as figures of a whole run: {_comment(listed(self.left_out))}.\n"
        empty = "    real unused; /* C has no empty struct */"
        return filled(
            files(__package__) / "program.h",
            NAME=self.name,
            GUARD=f"{self.name.upper()}_H",
            TITLE=_comment(title),
            VERSION=blockmech.__version__,
            HOW=_comment(settings),
            FLAGS=FLAGS,
            REASONS=", ".join(f"{i} {word}" for i, word in enumerate(WORDS)),
            LEFTOUT=omitted if self.left_out else "",
            REAL=self.real,
            PARAMETERS="\n".join(x.declared for x in self.parameters) or empty,
            INPUTS="\n".join(x.declared for x in self.inputs) or empty,
            OUTPUTS="\n".join(x.declared for x in self.outputs.values()) or empty,
        )

    @property
    def source(self) -> str:
        """Text of ``NAME.c``."""
        statements, body = self._statements
        suffix = "f" if self.real == FLOAT else ""
        calls = {"FABS": "fabs"} | {x.upper(): x for x in ("sqrt", "sin", "cos", "exp", "pow")}
        calls |= {x.upper(): x for x in ("atan2", "fmod", "hypot", "rint")}
        text = statements.helpers() + body
        defines = [f"#define {a} {b}{suffix}" for a, b in calls.items() if f"{a}(" in text]
        if "ROUNDING" in text:
            defines.append(f"#define ROUNDING {'FLT' if suffix else 'DBL'}_EPSILON")
        tables = [
            f"static const real table{k}[] = {{{self._row(table)}}};\n"
            for k, table in enumerate(self._trace.tables)
            if re.search(rf"\btable{k}\b", text)
        ]
        values = ((self._row(x.numbers), x.is_array) for x in self.parameters)
        unused = [f"    (void){x};" for x in ("p", "in") if f"{x}->" not in body]
        results = (
            f"    out->{x.name} = {statements.name(self._results[n])};"
            for n, x in self.outputs.items()
        )
        return filled(
            files(__package__) / "program.c",
            NAME=self.name,
            DEFINES="".join(f"{line}\n" for line in defines),
            DEFAULTS="\n".join(f"    {{{x}}}," if many else f"    {x}," for x, many in values)
            or "    0,",
            TABLES="".join(tables),
            HELPERS=statements.helpers(),
            BODY="\n".join([body.rstrip("\n"), *unused, *results]),
            WORD=statements.name(self._status),
        )

    def _row(self, numbers: Iterable[float]) -> str:
        return ", ".join(literal(x, self.real) for x in numbers)

    def test(self, samples: Samples) -> str:
        """Text of ``NAME_test.c``: what blockmech has for some samples."""
        from blockmech.result.result import Result

        inputs = samples.given(self.plan.program.inputs)
        values, _ = self.mechanism._evaluate(self.plan, samples)
        result = Result(self.mechanism, self.plan, samples, values, "", {"friction": "newton"})
        columns = [np.ravel(inputs[name]).tolist() for name in self.plan.program.inputs]
        expected = np.stack([self.column(result, name) for name in self.outputs], axis=1)
        allowed = TOLERANCES[self.real] * self._scales(expected)
        poses, k = range(samples.n), len(self.inputs)
        return filled(
            files(__package__) / "program_test.c",
            NAME=self.name,
            POSES=str(samples.n),
            WIDTH=str(max(k, 1)),
            COUNT=str(len(self.outputs)),
            GIVEN="\n".join(f"    {{{self._row([x[i] for x in columns])}}}," for i in poses)
            if k
            else "    {0},",
            EXPECTED="\n".join(f"    {{{self._row(row)}}}," for row in expected.tolist()),
            ALLOWED="\n".join(f"    {literal(x, self.real)}," for x in allowed.tolist()),
            WORDS=", ".join(str(WORDS.index(word)) for word in result.quality.status),
            TAKEN=", ".join(f"given[i][{j}]" for j in range(k)) or "0",
            MEMBERS=", ".join(f"out.{x.name}" for x in self.outputs.values()),
        )

    def _scales(self, expected: Array) -> Array:
        """The largest number among all outputs of the same unit: others may be rounding alone."""
        maxima = np.abs(np.where(np.isfinite(expected), expected, 0.0)).max(axis=0)
        units = [self.unit_of(name) for name in self.outputs]
        largest: dict[str, float] = {}
        for unit, x in zip(units, maxima.tolist(), strict=True):
            largest[unit] = max(largest.get(unit, 0.0), x)
        return np.array([largest[unit] or 1.0 for unit in units])

    def column(self, result: Any, name: str) -> Any:
        """A result's numbers (n,) for one member of the outputs."""
        output, part = self._parts[name]
        values = result[output]
        return getattr(values, part) if isinstance(part, str) else values[:, *part]


def poses(mechanism: Compiled, count: int = CHECKED) -> Samples:
    """Some samples of a mechanism: of its range, or where the file gives none, of a turn."""
    try:
        return mechanism.samples(None, count, None, None, None)
    except BlockmechError:
        at = {
            d: np.linspace(0.0, 6.0 if mechanism.structure.driver_joint(d).rotary else 1.0, count)
            for d in mechanism.drivers
        }
        return mechanism.samples(at, None, None, dict.fromkeys(at, 1.0), dict.fromkeys(at, 0.0))


class Names:
    """C names, each given once."""

    def __init__(self) -> None:
        self._taken: set[str] = set()

    def fresh(self, text: str) -> str:
        """A C name like a text, of its own."""
        name = numbered_name(identifier(text), self._taken)
        self._taken.add(name)
        return name


def filled(template: Traversable, **texts: str) -> str:
    """A file whose words @NAME@ are replaced by the texts of these names, each looked at once."""
    return re.sub("@([A-Z]+)@", lambda word: texts[word[1]], template.read_text("utf-8"))


def identifier(text: str) -> str:
    """A C name like a text."""
    word = re.sub(r"\W", "_", text, flags=re.ASCII)
    return f"m_{word}" if not word or word[0] in "_0123456789" or word in RESERVED else word


def function_name(text: str) -> str:
    """A name like a text for a function, which no function of the C library has."""
    word = identifier(text)
    return f"m_{word}" if word in LIBRARY else word


def _comment(text: str) -> str:
    """A text that ends no comment and begins no line."""
    return printable(text).replace("*/", "* /").replace("??", "? ?").rstrip("\\")


def _members(parameters: Record) -> Iterator[Member]:
    """The parameters of a program as members, in the order of the trace's."""
    names = Names()
    for name, value in parameters.items():
        yield from _of_value(name, value, names)


def _of_value(name: str, value: Nested, names: Names) -> Iterator[Member]:
    if isinstance(value, tuple):
        fields = getattr(value, "_fields", None) or [str(i) for i in range(len(value))]
        plain = not any(isinstance(x, tuple | complex | Planar) for x in value)
        if plain and value and not hasattr(value, "_fields"):
            yield Member(names.fresh(name), "", tuple(map(float, value)), is_array=True)
            return
        for field, x in zip(fields, value, strict=True):
            yield from _of_value(f"{name}_{field}", x, names)
    elif isinstance(value, complex | Planar):
        for part, x in (("x", value.real), ("y", value.imag)):
            yield Member(names.fresh(f"{name}_{part}"), "", (float(x),))
    else:
        yield Member(names.fresh(name), "", (float(value),))


def write_c(order: Order, path: Path) -> list[Path]:
    """``NAME.c``, ``NAME.h`` and ``NAME_test.c``, named after the file that is asked for."""
    program = CProgram(
        order.mechanism, order.want, order.options.get("real", DOUBLE), **order.settings
    )
    if path.suffix and path.suffix.lower() != ".c":
        raise refused(str(path), "C text is written to a file .c", "name it so")
    program.name = function_name(path.stem)
    samples = order.samples() or poses(order.mechanism)
    texts = {"h": program.header, "c": program.source}
    files = {path.with_name(f"{program.name}.{end}"): text for end, text in texts.items()}
    files[path.with_name(f"{program.name}_test.c")] = program.test(samples)
    refuse_spared(*files)
    for file, text in files.items():
        with writing(file) as stream:
            stream.write(text.encode("ascii", "replace"))
    return list(files)


WRITER = Writer(
    "C99 text: a function without heap or state, its header and a test program",
    (".c",),
    write_c,
    {"real": "double (default) or float, for small processors"},
)
