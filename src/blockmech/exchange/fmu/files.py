"""The format ``fmu``: model exchange and co-simulation of FMI 2.0, with its sources.

Sources are always inside; the machine's C compiler, where there is one, makes the binary for this
platform. States are the drivers' coordinates and rates, inputs the efforts on the drivers, outputs
what is wanted.

Source: Functional Mock-up Interface 2.0, Modelica Association, 2014.
"""

from __future__ import annotations

import io
import platform
import shutil
import subprocess
import tempfile
import uuid
import zipfile
from collections.abc import Iterable, Iterator
from importlib.resources import files
from pathlib import Path
from xml.sax.saxutils import quoteattr

import blockmech
from blockmech.errors import printable, refused
from blockmech.exchange.c.program import CProgram
from blockmech.exchange.formats import Order, Writer
from blockmech.files import writing
from blockmech.runnable import EVERYTHING

COMPILERS = ("cc", "gcc", "clang")
PLATFORMS = {"Linux": ("linux", ".so"), "Darwin": ("darwin", ".dylib"), "Windows": ("win", ".dll")}
STEP = 1e-3  # [s] of the co-simulation's own integration


class Unit:
    """The texts of a unit: model description and sources."""

    def __init__(self, order: Order) -> None:
        self.mechanism = mechanism = order.mechanism
        if not mechanism.drivers or mechanism.structure.followers:
            found = "a unit is a free motion of drivers, without couplings between them"
            raise refused("--to fmu", found, "write C text instead")
        drivers = mechanism.drivers
        self.of = {d: mechanism.of_driver(d, "")[:-1] for d in drivers}
        many = len(drivers) > 1
        own = [f"{self.of[d]}.drive" for d in drivers]
        own += ["mechanism.M"] if many else [f"{self.of[drivers[0]]}.J_red"]
        names = mechanism.outputs.match(order.want)
        wanted = [n for n in names if mechanism.outputs[n].kind != "number"]
        if order.want == EVERYTHING:
            wanted = [n for n in wanted if n.startswith("mechanism.") or n in own]
        self.program = CProgram(
            mechanism, tuple(dict.fromkeys([*own, *wanted])), **dict(order.settings)
        )
        self.step = float(order.options.get("step", STEP))
        if not 0 < self.step < 1e6:
            raise refused("step", f"got {self.step!r}", "give a time above 0 s")
        states = [f"{self.of[d]}.{what}" for what in ("q", "rate", "acceleration") for d in drivers]
        self.variables = [*states, *(f"{self.of[d]}.effort" for d in drivers)]
        self.outputs = [n for n in self.program.outputs if n not in self.variables]
        self.guid = str(uuid.uuid5(uuid.NAMESPACE_URL, self.program.source + "".join(self.outputs)))

    def start(self) -> list[float]:
        """Coordinates, then rates, at the start: the scene's, else the law's, else zero."""
        found: dict[str, tuple[float, float]] = {}
        scene = self.mechanism.scene
        for driver in self.mechanism.drivers:
            initial, law = scene.initial.get(driver), scene.drive.get(driver)
            first = (
                float(getattr(law, "start", 0.0) or 0.0),
                float(getattr(law, "rate", 0.0) or 0.0),
            )
            found[driver] = first if initial is None else (float(initial.q), float(initial.rate))
        return [x[i] for i in (0, 1) for x in found.values()]

    def wrapper(self) -> str:
        """Text of ``fmi2.c``."""
        p, drivers = self.program, list(self.mechanism.drivers)
        inputs = []
        for name, member in zip(p.plan.program.inputs, p.inputs, strict=True):
            quantity, _, i = name.rpartition("_")
            value = {"q": f"m->q[{i}]", "qd": f"m->rate[{i}]", "qdd": f"acceleration[{i}]"}
            inputs.append(f"    in.{member.name} = {value.get(quantity, 'm->time')};")
        inputs += ["    UNUSED(m);", "    UNUSED(acceleration);"]
        terms = []
        for n, a in enumerate(drivers):
            drive = p.outputs[f"{self.of[a]}.drive"].name
            terms.append(f"        step[{n}] = m->effort[{n}] - out.{drive};")
            for j, b in enumerate(drivers):
                one = f"mechanism.M.{a}.{b}" if len(drivers) > 1 else f"{self.of[a]}.J_red"
                terms.append(f"        inertia[{n}][{j}] = out.{p.outputs[one].name};")
        first = len(self.variables)
        outputs = [
            f"    m->values[{first + k}] = out.{p.outputs[n].name};"
            for k, n in enumerate(self.outputs)
        ]
        texts = {
            "NAME": p.name,
            "DRIVERS": str(len(drivers)),
            "VARIABLES": str(first + len(self.outputs)),
            "GUID": self.guid,
            "INPUTS": "\n".join(inputs),
            "TERMS": "\n".join(terms),
            "OUTPUTS": "\n".join(outputs),
            "START": ", ".join(map(repr, self.start())),
            "STEP": repr(self.step),
        }
        text = (files("blockmech.exchange.fmu") / "fmi2.c").read_text("utf-8")
        for word, content in texts.items():
            text = text.replace(f"@{word}@", content)
        return text

    def description(self) -> str:
        """Text of ``modelDescription.xml``."""
        p, k = self.program, len(self.mechanism.drivers)
        start = self.start()
        name = quoteattr(printable(self.mechanism.name))
        sources = f'<SourceFiles><File name="{p.name}.c"/><File name="fmi2.c"/></SourceFiles>'
        lines = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<fmiModelDescription fmiVersion="2.0" modelName={name} guid="{self.guid}"'
            f' generationTool="blockmech {blockmech.__version__}"'
            ' variableNamingConvention="structured" numberOfEventIndicators="0">',
            f'<ModelExchange modelIdentifier="{p.name}" canGetAndSetFMUstate="true"'
            f' canSerializeFMUstate="true">{sources}</ModelExchange>',
            f'<CoSimulation modelIdentifier="{p.name}"'
            ' canHandleVariableCommunicationStepSize="true"'
            f' canGetAndSetFMUstate="true" canSerializeFMUstate="true">{sources}</CoSimulation>',
            "<ModelVariables>",
        ]
        for i, variable in enumerate(self.variables):
            kind, of = divmod(i, k)
            if kind < 2:
                rest = f' start="{start[i]!r}"' + (f' derivative="{of + 1}"' if kind == 1 else "")
                how = 'causality="output" initial="exact"'
            elif kind == 2:
                rest, how = f' derivative="{k + of + 1}"', 'causality="output" initial="calculated"'
            else:
                rest, how = ' start="0"', 'causality="input"'
            lines.append(_variable(variable, i, how, rest))
        first = len(self.variables)
        for j, output in enumerate(self.outputs):
            how = 'causality="output" initial="calculated"'
            lines.append(_variable(output, first + j, how, ""))
        shown = [*range(3 * k), *range(first, first + len(self.outputs))]
        computed = [*range(k, 3 * k), *range(first, first + len(self.outputs))]
        lines += ["</ModelVariables>", "<ModelStructure>", "<Outputs>", *_unknowns(shown)]
        lines += ["</Outputs>", "<Derivatives>", *_unknowns(range(k, 3 * k)), "</Derivatives>"]
        initial = [x for x in computed if x >= 2 * k]
        lines += ["<InitialUnknowns>", *_unknowns(initial), "</InitialUnknowns>"]
        return "\n".join([*lines, "</ModelStructure>", "</fmiModelDescription>"]) + "\n"


def _variable(name: str, reference: int, how: str, rest: str) -> str:
    text = quoteattr(printable(name))
    return (
        f'<ScalarVariable name={text} valueReference="{reference}" variability="continuous" {how}>'
        f"<Real{rest}/></ScalarVariable>"
    )


def _unknowns(indices: Iterable[int]) -> Iterator[str]:
    for i in indices:
        yield f'<Unknown index="{i + 1}"/>'


def binary(sources: dict[str, str], name: str) -> tuple[str, bytes] | None:
    """The place in the unit and the bytes of the library for this platform; None without a C
    compiler. Raises `RequestError` where the compiler fails."""
    compiler = next((c for c in COMPILERS if shutil.which(c)), None)
    if compiler is None or platform.system() not in PLATFORMS:
        return None
    system, suffix = PLATFORMS[platform.system()]
    with tempfile.TemporaryDirectory() as folder:
        for file, text in sources.items():
            Path(folder, file).write_text(text, "utf-8")
        made = Path(folder, name + suffix)
        how = [] if system == "win" else ["-fPIC", "-fvisibility=hidden"]
        command = [compiler, "-std=c99", "-O2", "-ffp-contract=off", "-shared", *how]
        command += [f for f in sources if f.endswith(".c")] + ["-lm", "-o", str(made)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise refused("--to fmu", f"{compiler} fails: {done.stderr.strip()[:300]}", "report it")
        return f"binaries/{system}64/{name}{suffix}", made.read_bytes()


def write_fmu(order: Order, path: Path) -> list[Path]:
    """One file ``.fmu``: description, sources, and the binary if a C compiler is at hand."""
    unit = Unit(order)
    p = unit.program
    sources = {f"{p.name}.h": p.header, f"{p.name}.c": p.source, "fmi2.c": unit.wrapper()}
    made = binary(sources, p.name)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", unit.description())
        for file, text in sources.items():
            archive.writestr(f"sources/{file}", text)
        if made is not None:
            archive.writestr(*made)
    with writing(path) as stream:
        stream.write(packed.getvalue())
    return [path]


WRITER = Writer(
    "FMU (FMI 2.0): model exchange and co-simulation, sources and binary",
    (".fmu",),
    write_fmu,
    {"step": "of the co-simulation's own Runge-Kutta steps, at most [s]; default 1e-3"},
)
