"""The format ``fmu``: model exchange and co-simulation of FMI 2.0 or 3.0, with its sources.

Sources are always inside; the machine's C compiler, where there is one, makes the binary for this
platform. States are the drivers' coordinates and rates, then those of signal blocks and friction
laws; inputs the efforts on the drivers and blocks ``signal.input``, outputs what is wanted.
States of blocks in continuous time, and deflections of friction laws, are states of the unit; what
discrete blocks hold changes at events in time (FMI 2.0, section 3.2.2).

Sources: Functional Mock-up Interface 2.0 and 3.0, Modelica Association, 2014 and 2022.
"""

from __future__ import annotations

import math
import platform
import re
import shutil
import subprocess
import tempfile
import uuid
import zipfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import IO, NamedTuple
from xml.sax.saxutils import quoteattr

import blockmech
from blockmech.compiled import Compiled
from blockmech.dynamics.request import refuse_no_inertia
from blockmech.exchange.c.program import CProgram, filled
from blockmech.exchange.formats import Order, Writer, file_writer
from blockmech.ground.errors import among, listed, printable, refused
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.structure import JointRef
from blockmech.passes import friction, signals
from blockmech.plan.plan import Output, Schedule
from blockmech.plan.values import Value
from blockmech.result.quality import NOT_CONVERGED, WORDS
from blockmech.signals.sources import Input
from blockmech.typing import Real


class Discrete(NamedTuple):
    """When a discrete block switches, and whether it reads others.

    Each ``period`` [s] or, where that is 0, once at a ``time`` [s].
    """

    period: float
    time: float
    reads: bool


class States:
    """The states of a mechanism's signal blocks and friction laws.

    Attributes
    ----------
    initial : where all begin, in the order of `Structure.states`
    continuous : name of a state that the unit integrates -> its place among all
    inputs : name of a block that is fed from outside -> the place of what it holds
    discrete : when the blocks that hold their outputs switch
    switched : (output that a state becomes, its place, number of its block)
    rates : those outputs, and the rates ``der(state)``
    outputs : names of all outputs of signal blocks
    """

    def __init__(self, mechanism: Compiled, method: str | None) -> None:
        structure, names = mechanism.structure, mechanism.names
        labels = {} if names is None else {block: name for name, block in names.signals.items()}
        self.initial = structure.initial_states
        self.continuous: dict[str, int] = {}
        self.inputs: dict[str, int] = {}
        self.discrete: list[Discrete] = []
        self.switched: list[tuple[str, int, int]] = []
        self.rates: dict[str, Output] = {}
        self.outputs: list[str] = []
        for block, signal in structure.signals.items():
            name = labels.get(block, block)
            self.outputs += [f"{name}.{port}" for port in signal.ports]
            indices = {x: structure.states[JointRef(block, x)] for x in signal.states}
            if isinstance(signal, Input):
                (self.inputs[name],) = indices.values()
                continue
            for x, i in indices.items():
                if signal.discrete:
                    self.switched.append((f"next({name}.{x})", i, len(self.discrete)))
                    self._add(f"next({name}.{x})", partial(_next, JointRef(block, x)))
                else:
                    self.continuous[f"{name}.{x}"] = i
                    self._add(f"der({name}.{x})", partial(_rate, i))
            if signal.discrete:
                time = 0.0 if signal.interval else signal.instant(0.0)
                self.discrete.append(Discrete(signal.interval or 0.0, time, bool(signal.inputs)))
        for ref in structure.remembering if method != "none" else ():
            name = f"{mechanism._joint_names.get(str(ref), str(ref))}.deflection"
            self.continuous[name] = structure.states[ref]
            self._add(f"der({name})", partial(friction.deflection_rate, ref=ref))

    def _add(self, name: str, rule: Callable[[Schedule], Value]) -> None:
        self.rates[name] = Output(name, "", "real", lambda s: (rule(s),), lambda x: x)


def _rate(i: int, s: Schedule) -> Value:
    return s.ask(signals.rates)[i]


def _next(ref: JointRef, s: Schedule) -> Value:
    return s.ask(signals.updated)[ref]


COMPILERS = ("cc", "gcc", "clang")
SUFFIXES = {"Linux": ".so", "Darwin": ".dylib", "Windows": ".dll"}
PLATFORMS = {  # version of FMI -> system -> folder of its binaries
    "2": {"Linux": "linux64", "Darwin": "darwin64", "Windows": "win64"},
    "3": {"Linux": "{}-linux", "Darwin": "{}-darwin", "Windows": "{}-windows"},
}
MACHINES = {"AMD64": "x86_64", "arm64": "aarch64", "ARM64": "aarch64"}  # names of FMI 3
BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
DERIVED = {"N": "kg m s-2", "J": "kg m2 s-2", "W": "kg m2 s-3", "Pa": "kg m-1 s-2", "Hz": "s-1"}
DERIVED |= {"V": "kg m2 s-3 A-1"}
TIME = 0x7FFFFFFF  # value reference of FMI 3's independent variable, as in unit.h
ATTRIBUTES = "unit", "start", "derivative"  # of the type of a variable, in FMI 2
STEP = 1e-3  # [s] of the co-simulation's own integration


class Variable(NamedTuple):
    """A variable of a unit; its value reference is its place among all.

    lvalue : what the C text calls it
    start : of what can be set: states and inputs
    derivative : of a rate, the state's value reference
    """

    name: str
    lvalue: str
    causality: str = "output"
    start: float | None = None
    derivative: int | None = None


class Unit:
    """The texts of a unit: model description and sources."""

    def __init__(self, order: Order) -> None:
        self.mechanism = mechanism = order.mechanism
        if not mechanism.drivers:
            message = "a unit is a free motion of drivers, and the mechanism has none"
            raise refused("--to fmu", message, "write C text instead")
        if bound := [d for d, role in mechanism.scene.motion.items() if role != "free"]:
            message = f"a unit moves all drivers by their efforts, and {listed(bound)} is not free"
            raise refused("--to fmu", message, 'leave "motion" out, and give the unit the effort')
        mechanism._once(refuse_no_inertia)
        self.fmi = str(order.options.get("fmi", "2"))
        among(PLATFORMS, "version", self.fmi, where="fmi")
        drivers = mechanism.drivers
        self.of = {d: mechanism._of_driver(d, "")[:-1] for d in drivers}
        many = len(drivers) > 1
        dynamics, frictionless = (
            [f"{self.of[d]}.{x}" for d in drivers] for x in ("drive", "drive_by_reduction")
        )
        dynamics += ["mechanism.M"] if many else [f"{self.of[drivers[0]]}.J_red"]
        names = mechanism.outputs.match(order.want)
        requested = [n for n in names if mechanism.outputs[n].kind != "number"]
        self.states = States(mechanism, order.settings.get("friction"))
        if order.want == EVERYTHING:
            defaults = (*dynamics, *self.states.outputs)
            requested = [n for n in requested if n.startswith("mechanism.") or n in defaults]
        self.program = CProgram(
            mechanism,
            tuple(dict.fromkeys([*dynamics, *frictionless, *requested])),
            rates=self.states.rates.values(),
            **dict(order.settings),
        )
        self.step = order.positive("step", STEP, "s", "1ms")
        self.starts = [mechanism.scene.start_of(d) for d in drivers]
        self.variables = self._variables()
        self.guid = str(uuid.uuid5(uuid.NAMESPACE_URL, self.program.source + repr(self.variables)))

    def _variables(self) -> list[Variable]:
        """Coordinates, rates, accelerations, efforts; states, their rates; inputs; outputs."""
        of, k, states = list(enumerate(self.of.values())), len(self.of), self.states
        start = self.starts
        variables = [
            *(Variable(f"{x}.q", f"m->q[{i}]", start=start[i][0]) for i, x in of),
            *(Variable(f"{x}.rate", f"m->rate[{i}]", "output", start[i][1], i) for i, x in of),
            *(
                Variable(f"{x}.acceleration", f"m->acceleration[{i}]", derivative=k + i)
                for i, x in of
            ),
            *(Variable(f"{x}.effort", f"m->effort[{i}]", "input", 0.0) for i, x in of),
        ]
        first, initial = len(variables), states.initial
        continuous, inputs = states.continuous.items(), states.inputs.items()
        variables += [Variable(x, f"m->x[{i}]", "output", initial[i]) for x, i in continuous]
        variables += [
            Variable(f"der({x})", f"m->slope[{j}]", "local", None, first + j)
            for j, x in enumerate(states.continuous)
        ]
        variables += [Variable(x, f"m->x[{i}]", "input", initial[i]) for x, i in inputs]
        names = {*(v.name for v in variables), *states.rates}
        p = self.program.outputs
        variables += [Variable(n, f"out.{p[n].name}") for n in p if n not in names]
        return variables

    def sources(self) -> dict[str, str]:
        """The texts in C, by the names of their files."""
        p, folder = self.program, files(__package__)
        interface = f"fmi{self.fmi}.c"
        text = (folder / interface).read_text("utf-8")
        return {f"{p.name}.h": p.header, f"{p.name}.c": p.source} | {
            "unit.h": self._unit_text(),
            interface: text,
        }

    def _unit_text(self) -> str:
        """Text of ``unit.h``."""
        p, drivers, states = self.program, list(self.mechanism.drivers), self.states
        inputs = []
        for name, member in zip(p.plan.program.inputs, p.inputs, strict=True):
            quantity, _, i = name.rpartition("_")
            value = {"q": f"m->q[{i}]", "qd": f"m->rate[{i}]", "qdd": f"acceleration[{i}]"}
            value |= {"x": f"m->x[{i}]"}
            inputs.append(f"    in.{member.name} = {value.get(quantity, 'm->time')};")
        terms, first = list[str](), list[str]()
        for n, a in enumerate(drivers):
            for lines, drive in ((terms, "drive"), (first, "drive_by_reduction")):
                name = p.outputs[f"{self.of[a]}.{drive}"].name
                lines.append(f"            rest[{n}] = m->effort[{n}] - out.{name};")
            for j, b in enumerate(drivers):
                entry = f"mechanism.M.{a}.{b}" if len(drivers) > 1 else f"{self.of[a]}.J_red"
                first.append(f"            inertia[{n}][{j}] = out.{p.outputs[entry].name};")
        rates = {name: f"out.{p.outputs[name].name}" for name in states.rates}
        slopes = [rates[f"der({n})"] for n in states.continuous]
        outputs = [
            *(f"    m->slope[{j}] = {slope};" for j, slope in enumerate(slopes)),
            *(f"    m->next[{j}] = {rates[n]};" for j, (n, *_) in enumerate(states.switched)),
            *(f"    m->values[{k}] = {v.lvalue};" for k, v in enumerate(self.variables)),
        ]
        sets = [
            f"        case {k}: {v.lvalue} = values[i]; break;"
            for k, v in enumerate(self.variables)
            if v.start is not None
        ]
        starts = [x[i] for i in (0, 1) for x in self.starts]
        texts = {
            "NAME": p.name,
            "DRIVERS": str(len(drivers)),
            "ALL": str(len(states.initial)),
            "STATES": str(len(states.continuous)),
            "SWITCHED": str(len(states.switched)),
            "BLOCKS": str(len(states.discrete)),
            "VARIABLES": str(len(self.variables)),
            "GUID": self.guid,
            "INPUTS": "\n".join(inputs),
            "TERMS": "\n".join(terms),
            "FRICTIONLESS": "\n".join(first),
            "NOTCONVERGED": str(WORDS.index(NOT_CONVERGED)),
            "OUTPUTS": "\n".join(outputs),
            "SETS": "\n".join(sets),
            "START": _row(starts),
            "INITIAL": _row(states.initial),
            "PLACES": _row(states.continuous.values()),
            "SWITCHES": _row(i for _, i, _ in states.switched),
            "OF": _row(block for *_, block in states.switched),
            "PERIODS": _row(x.period for x in states.discrete),
            "TIMES": _row(x.time for x in states.discrete),
            "READS": _row(int(x.reads) for x in states.discrete),
            "STEP": repr(self.step),
        }
        return filled(files(__package__) / "unit.h", **texts)

    def _attributes(self) -> Iterator[dict[str, str]]:
        """Attributes of each variable."""
        for i, variable in enumerate(self.variables):
            attributes = {
                "name": printable(variable.name),
                "valueReference": str(i),
                "variability": "continuous",
                "causality": variable.causality,
            }
            if variable.causality != "input":
                attributes["initial"] = "calculated" if variable.start is None else "exact"
            if variable.start is not None:
                attributes["start"] = repr(variable.start)
            if variable.derivative is not None:
                attributes["derivative"] = str(variable.derivative)
            if (output := self._output(variable.name)) is not None:
                attributes["description"] = printable(output.about)
                attributes |= {"unit": output.unit} if output.unit else {}
            yield attributes

    def _output(self, name: str) -> Output | None:
        """What a variable is a part of; an effort from outside is like the drive in its place."""
        outputs, (head, _, last) = self.mechanism.outputs, name.rpartition(".")
        name = f"{head}.drive" if last == "effort" else name
        while name and name not in outputs:
            name = name.rpartition(".")[0]
        return outputs.get(name)

    def description(self) -> str:
        """Text of ``modelDescription.xml``."""
        p, two = self.program, self.fmi == "2"
        states = {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true"}
        if not two:
            states = {name.replace("state", "State"): x for name, x in states.items()}
        model = {"modelIdentifier": p.name, **states}
        steps = {"canHandleVariableCommunicationStepSize": "true"}
        about = {
            "fmiVersion": f"{self.fmi}.0",
            "modelName": printable(self.mechanism.name),
            "guid" if two else "instantiationToken": self.guid,
            "generationTool": f"blockmech {blockmech.__version__}",
            "variableNamingConvention": "structured",
        }
        inside = f"<SourceFiles>{self._files()}</SourceFiles>" if two else ""
        lines = ['<?xml version="1.0" encoding="UTF-8"?>', _open("fmiModelDescription", about)]
        lines += [
            f"{_open(kind, model | extra)}{inside}</{kind}>"
            for kind, extra in (("ModelExchange", {}), ("CoSimulation", steps))
        ]
        units = sorted({x["unit"] for x in self._attributes() if "unit" in x})
        lines += ["<UnitDefinitions>", *map(_unit_definition, units), "</UnitDefinitions>"]
        lines.append("<ModelVariables>")
        for variable in self._attributes():
            if not two:
                lines.append(_open("Float64", variable, "/>"))
                continue
            real = {x: variable.pop(x) for x in ATTRIBUTES if x in variable}
            if "derivative" in real:
                real["derivative"] = str(int(real["derivative"]) + 1)  # counts from 1
            inner = _open("Real", real, "/>")
            lines.append(f"{_open('ScalarVariable', variable)}{inner}</ScalarVariable>")
        if not two:
            time = {"name": "time", "valueReference": str(TIME)}
            time |= {"causality": "independent", "variability": "continuous"}
            lines.append(_open("Float64", time, "/>"))
        numbered = list(enumerate(self.variables))
        unknowns = {
            "Output": [i for i, v in numbered if v.causality == "output"],
            "ContinuousStateDerivative": [i for i, v in numbered if v.derivative is not None],
            "InitialUnknown": [i for i, v in numbered if v.start is None],
        }
        lines += ["</ModelVariables>", "<ModelStructure>", *_structure(unknowns, two)]
        return "\n".join([*lines, "</ModelStructure>", "</fmiModelDescription>"]) + "\n"

    def build_description(self) -> str:
        """Text of ``sources/buildDescription.xml`` of FMI 3."""
        build = _open("BuildConfiguration", {"modelIdentifier": self.program.name})
        files = _open("SourceFileSet", {"language": "C99", "compiler": "gcc"}) + self._files()
        library = _open("Library", {"name": "m"}, "/>")
        return (
            '<?xml version="1.0" encoding="UTF-8"?>\n'
            f"{_open('fmiBuildDescription', {'fmiVersion': '3.0'})}\n{build}\n"
            f"{files}</SourceFileSet>\n{library}\n</BuildConfiguration>\n</fmiBuildDescription>\n"
        )

    def _files(self) -> str:
        return "".join(
            f"<{'File' if self.fmi == '2' else 'SourceFile'} name={quoteattr(name)}/>"
            for name in (f"{self.program.name}.c", f"fmi{self.fmi}.c")
        )


def _unit_definition(text: str) -> str:
    """A unit in powers of base units, e.g. ``N m`` as kg m2 s-2."""
    powers: Counter[str] = Counter()
    for k, part in enumerate(text.split("/")):
        for symbol, power in re.findall(r"([A-Za-z]+)(-?\d*)", part):
            times = int(power or 1) * (-1 if k else 1)
            for base, exponent in re.findall(r"([A-Za-z]+)(-?\d*)", DERIVED.get(symbol, symbol)):
                powers[base] += times * int(exponent or 1)
    bases = {base: str(n) for base, n in powers.items() if n and base in BASES}
    return f"{_open('Unit', {'name': text})}{_open('BaseUnit', bases, '/>')}</Unit>"


def _row(numbers: Iterable[Real]) -> str:
    """The entries of an array in C, which has none without entries."""
    return ", ".join(map(_number, numbers)) or "0"


def _number(x: float) -> str:
    return "INFINITY" if x == math.inf else repr(x)


def _open(tag: str, attributes: Mapping[str, str], end: str = ">") -> str:
    """The start of an element, or with ``/>`` the whole one."""
    return f"<{tag}{''.join(f' {k}={quoteattr(x)}' for k, x in attributes.items())}{end}"


def _structure(unknowns: Mapping[str, Iterable[int]], two: bool) -> Iterator[str]:
    """The parts of a model's structure: of FMI 2 by index in lists, of FMI 3 by reference."""
    lists = {"Output": "Outputs", "ContinuousStateDerivative": "Derivatives"}
    for kind, references in unknowns.items():
        if not two:
            yield from (f'<{kind} valueReference="{i}"/>' for i in references)
            continue
        inside = "".join(f'<Unknown index="{i + 1}"/>' for i in references)
        name = lists.get(kind, "InitialUnknowns")
        yield f"<{name}>{inside}</{name}>"


def binary(sources: Mapping[str, str], name: str, fmi: str) -> tuple[str, bytes] | None:
    """The place in the unit and the bytes of the library for this platform; None without a C
    compiler. Raises `RequestError` where the compiler fails."""
    compiler = next((c for c in COMPILERS if shutil.which(c)), None)
    system = platform.system()
    if compiler is None or system not in SUFFIXES:
        return None
    suffix = SUFFIXES[system]
    machine = MACHINES.get(platform.machine(), platform.machine())
    system_folder = PLATFORMS[fmi][system].format(machine)
    with tempfile.TemporaryDirectory() as folder:
        for file, text in sources.items():
            Path(folder, file).write_text(text, "utf-8")
        library = Path(folder, name + suffix)
        flags = [] if system == "Windows" else ["-fPIC", "-fvisibility=hidden"]
        command = [compiler, "-std=c99", "-O2", "-ffp-contract=off", "-shared", *flags]
        command += [f for f in sources if f.endswith(".c")] + ["-lm", "-o", str(library)]
        completed = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if completed.returncode:
            raise refused(
                "--to fmu", f"{compiler} fails: {completed.stderr.strip()[:300]}", "report it"
            )
        return f"binaries/{system_folder}/{name}{suffix}", library.read_bytes()


@file_writer
def write_fmu(order: Order, stream: IO[bytes]) -> None:
    """One file ``.fmu``: description, sources, and the binary if a C compiler is at hand."""
    unit = Unit(order)
    sources = unit.sources()
    library = binary(sources, unit.program.name, unit.fmi)
    if unit.fmi == "3":
        sources |= {"buildDescription.xml": unit.build_description()}
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", unit.description())
        for file, text in sources.items():
            archive.writestr(f"sources/{file}", text)
        if library is not None:
            archive.writestr(*library)


WRITER = Writer(
    "FMU (FMI 2.0 or 3.0): model exchange and co-simulation, sources and binary",
    (".fmu",),
    write_fmu,
    {
        "fmi": "2 (default) or 3, the version of the standard",
        "step": "of the co-simulation's own Runge-Kutta steps, at most [s]; default 1e-3",
    },
)
