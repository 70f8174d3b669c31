"""Every public call on a mechanism, with arguments that fit it, and what may come of one.

Methods of `Mechanism` each have a line in `CALLS`; formats that are written, kinds of pictures and
commands are taken from where they are declared. A call ends in an answer or in an error of ours;
an answer shows itself as text, in a notebook, as JSON and as a picture, and is pickled.
"""

from __future__ import annotations

import json
import pickle
import re
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from functools import cached_property, partial
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import blockmech as bm
from blockmech.builders import opened
from blockmech.draw import KINDS, animate, draw, plot, run_pictures, svg
from blockmech.draw.simulation import motion_svg
from blockmech.exchange.formats import WRITERS
from blockmech.figures.paper import Pictured
from blockmech.ground.report import Facts, Report
from blockmech.result.quality import OK
from blockmech.result.result import Result
from tests.gallery import GRAPHS

SAMPLES = 5
MOVES = "time=0.05"
BUDGET = 3.0  # [s] of a motion, which then ends in its own words; most take a hundredth of it
REFUSED = ("broken/", "legacy/")  # files that are no mechanism, or of blocks that are not installed
FEW = 3  # numbers of a design where a call takes several


def gallery_files() -> list[str]:
    """Every file of the gallery that can be read, by its path in it."""
    paths = (path.relative_to(GRAPHS).as_posix() for path in sorted(GRAPHS.rglob("*.json")))
    return [path for path in paths if not path.startswith(REFUSED)]


class Subject:
    """A document with what its calls are asked about: poses, outputs and numbers that it has."""

    def __init__(self, document: Any, mechanism: Any = None) -> None:
        self.document, self.mechanism = document, mechanism or document.compile()

    @classmethod
    def of(cls, path: Path) -> Subject:
        """What stands in a file, without the numbers that it expects."""
        document = opened(path)
        document.extras.pop("expect", None)
        return cls(document)

    @cached_property
    def places(self) -> dict[str, Any]:
        """Samples at which it has an answer: of its laws, else near the start of its scene."""
        starts = self.mechanism.scene.initial
        base = {d: starts[d].q if d in starts else 0.0 for d in self.mechanism.drivers}
        near = {d: q + np.array([0.0, 0.05, 0.1]) for d, q in base.items()}
        far = {d: q + np.array([0.7, 1.2, 2.0]) for d, q in base.items()}
        for request in ({"samples": SAMPLES}, {"at": near}, {"at": far}):
            try:
                self.mechanism.run(**request, want="*.q")
            except bm.BlockmechError:
                continue
            return request
        return {"samples": SAMPLES}

    @cached_property
    def pose(self) -> dict[str, float]:
        """One place of every driver."""
        try:
            result = self.mechanism.run(**self.places, want="*.q", on_gap="mark")
        except bm.BlockmechError:
            return dict.fromkeys(self.mechanism.drivers, 0.0)
        at = result.samples
        return {d: float(at.coordinate(i)[at.n // 2]) for i, d in enumerate(self.mechanism.drivers)}

    @cached_property
    def outputs(self) -> list[str]:
        """One output of each last name, such as ``crank.drive`` and ``crank.q``."""
        last = {name.rpartition(".")[2]: name for name in self.mechanism.outputs}
        return list(last.values())

    @cached_property
    def output(self) -> str:
        """The drive of a driver, or else what there is."""
        drives = [name for name in self.mechanism.outputs if name.endswith(".drive")]
        return (drives or self.outputs)[0]

    @cached_property
    def numbers(self) -> dict[str, float]:
        """A few numbers of the design that are not 0, lengths first."""
        parameters = [p for p in self.mechanism.parameters().values() if p.value]
        parameters.sort(key=lambda p: p.unit != "m")
        return {p.address: p.value for p in parameters[:FEW]}

    @cached_property
    def result(self) -> Result:
        """Its run at the places."""
        return self.mechanism.run(**self.places, on_gap="mark")

    @cached_property
    def motion(self) -> Result:
        """Its motion over a short time."""
        return self.mechanism.simulate(MOVES, want="*", budget=BUDGET)

    @property
    def links(self) -> list[str]:
        """Names of links as outputs have them."""
        names = (n for n in self.mechanism.outputs if n.endswith(".omega"))
        return [n.removeprefix("link.").removesuffix(".omega") for n in names]


Call = Callable[[Subject], Any]


def _identify(s: Subject) -> Any:
    s.mechanism.run(**s.places, want=["*.q", "*.rate", "*.acceleration", s.output], on_gap="raise")
    names = [n for n in s.mechanism.outputs if n.endswith((".q", ".rate", ".acceleration"))]
    run = s.mechanism.run(**s.places, want=[*names, s.output])
    columns = {n: run[n] for n in run if np.isrealobj(run[n])}
    return bm.design.identify(s.mechanism, list(s.numbers)[:1], columns)


def _stepper(s: Subject) -> Any:
    stepper = s.mechanism.stepper(copies=2)
    repr(stepper)
    return stepper.step(0.01)


def _impulses(s: Subject) -> Any:
    motion = s.mechanism.simulate("time=0.3", budget=BUDGET).motion
    return [s.mechanism.impulses(impact) for impact in motion.impacts[:2]]


def _objective(s: Subject) -> Any:
    f = s.mechanism.objective(s.numbers, want=f"max_abs({s.output})", **s.places)
    return repr(f), f(f.start), f.jacobian(f.start)


def _linearize(s: Subject) -> Any:
    drives = [n for n in s.mechanism.outputs if n.endswith(".drive")]
    return s.mechanism.linearize(s.pose, inputs=drives[:1], outputs=s.mechanism.drivers[:1])


def _modes_shown(s: Subject) -> Any:
    linear = s.mechanism.linearize(s.pose)
    with tempfile.TemporaryDirectory() as home:
        for number in range(len(linear.modes)):
            linear.animate(number, Path(home) / "it.html")


def _study(s: Subject, **options: Any) -> Any:
    vary = {address: np.array([1.0, 1.001]) * x for address, x in islice(s.numbers.items(), 1)}
    want = [
        f"{reduction}({s.output})"
        for reduction in ("max_abs", "min", "max", "range", "mean", "rms")
    ]
    return s.mechanism.study(vary, want=want, **s.places, **options)


def _study_out(s: Subject) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        return _study(s, out=Path(folder) / "study")


def _study_of_motions(s: Subject) -> Any:
    vary = {address: np.array([1.0, 1.001]) * x for address, x in islice(s.numbers.items(), 1)}
    name = next(n for n in s.mechanism.outputs if n.endswith(".q"))
    return s.mechanism.study(vary, want=[f"end({name})", "t_end"], simulate={"until": MOVES})


def _tolerance(s: Subject) -> Any:
    scatter = {address: bm.dist.Normal(x, 1e-3 * abs(x)) for address, x in s.numbers.items()}
    return s.mechanism.tolerance(scatter, s.output, **s.places, count=20)


def _enclose(s: Subject) -> Any:
    tolerances = {address: 1e-6 * abs(x) for address, x in s.numbers.items()}
    return s.mechanism.enclose(**s.places, tolerance=tolerances, want=s.output)


def _function(s: Subject) -> Any:
    inputs = {s.mechanism._of_driver(d, "q"): q for d, q in s.pose.items()}
    rates = {
        s.mechanism._of_driver(d, quantity): 0.0
        for d in s.pose
        for quantity in ("rate", "acceleration")
    }
    inputs = {**inputs, **rates, "time": 0.0}
    f = s.mechanism.function(inputs, s.output, [*s.numbers], library="numpy")
    return f(f.parameters, inputs)


def _rates(s: Subject) -> Any:
    f, q = s.mechanism.rates(library="numpy", friction="none"), np.array([*s.pose.values()])
    return f(0.0, (q, 0.0 * q), f.parameters)


def _replaced(s: Subject) -> None:
    """Every number of the document, one at a time: its own value, and a slightly other one."""
    for address, p in s.mechanism.parameters().items():
        for value in (p.value, p.value * 1.001 + 1e-6):
            try:
                s.document.replace({address: value}).compile()
            except bm.BlockmechError:
                if value == p.value:
                    raise AssertionError(f"{address} cannot have its own value") from None


def _each(of: Callable[[Any, str], Any]) -> Call:
    """A call for one output of each last name."""

    def calls(s: Subject) -> Any:
        answers = []
        for name in s.outputs:
            try:
                answers.append(of(s.mechanism, name))
            except bm.BlockmechError as error:
                refusal(error)
        return answers

    return calls


METHODS: dict[str, Call] = {
    "available": lambda s: bm.design.available(s.mechanism, next(iter(s.numbers)), 1.0, s.pose),
    "balance": lambda s: bm.design.balance(s.mechanism, [*s.numbers][:1], **s.places),
    "draw": lambda s: s.mechanism.draw(kind="mechanism", at=s.pose),
    "enclose": _enclose,
    "equilibria": lambda s: s.mechanism.equilibria(starts=4),
    "explain": lambda s: s.mechanism.explain(),
    "extremes": _each(lambda m, name: m.extremes(name)),
    "floquet": lambda s: bm.design.floquet(
        s.mechanism, s.mechanism.simulate("time=0.05", budget=BUDGET), steps=8
    ),
    "flywheel": lambda s: bm.design.flywheel(s.mechanism, 10.0, 0.02),
    "friction_solutions": lambda s: s.mechanism.friction_solutions(**s.places),
    "function": _function,
    "identify": _identify,
    "impulses": _impulses,
    "instant_centre": lambda s: s.mechanism.instant_centre(s.links[0], at=s.pose),
    "limits": lambda s: s.mechanism.limits(),
    "linearize": _linearize,
    "mechanical_advantage": lambda s: s.mechanism.mechanical_advantage(
        s.links[-1], s.links[0], at=s.pose
    ),
    "modes": lambda s: s.mechanism.modes(),
    "motor": lambda s: bm.design.motor(s.mechanism, **s.places),
    "objective": _objective,
    "parameters": lambda s: s.mechanism.parameters(),
    "path_radius": lambda s: [
        s.mechanism.path_radius(n.removesuffix(".a").removeprefix("link."), at=s.pose)
        for n in s.mechanism.outputs
        if n.endswith(".a")
    ],
    "rates": _rates,
    "run": lambda s: s.mechanism.run(**s.places, on_gap="mark"),
    "run_to": lambda s: s.mechanism.run(**s.places, accuracy=1e-6, on_gap="mark"),
    "sensitivity": lambda s: s.mechanism.sensitivity(s.output, **s.places),
    "simulate": lambda s: s.mechanism.simulate(MOVES, want="*", budget=BUDGET),
    "solve": lambda s: (
        s.mechanism.solve(dict.fromkeys(s.mechanism.drivers and [s.output], 0.5))
        if len(s.mechanism.drivers) == 1
        else None
    ),
    "stepper": _stepper,
    "stroke": _each(lambda m, name: m.stroke(name)),
    "study": _study,
    "tolerance": _tolerance,
    "trade": lambda s: s.mechanism.trade("run", s.output, budget=0.05, **s.places),
    "velocity_ratio": lambda s: s.mechanism.velocity_ratio(s.links[-1], s.links[0], at=s.pose),
    "verify": lambda s: s.mechanism.verify(**s.places),
}
"""Public methods of a mechanism; `with_deflections` and others are steps of these."""

MORE: dict[str, Call] = {
    "check": lambda s: [s.document.check(), getattr(s.document, "remarks", list)()],
    "shown": lambda s: [repr(s.document), s.document._repr_svg_(), s.mechanism._repr_svg_()],
    "written": lambda s: type(s.document).from_json(s.document.to_json()).to_json(),
    "decompose": lambda s: repr(s.document.decompose()) if hasattr(s.document, "decompose") else "",
    "numpy": lambda s: s.mechanism.run(**s.places, engine="numpy", on_gap="mark"),
    "complex64": lambda s: s.mechanism.run(**s.places, precision="complex64", on_gap="mark"),
    "static": lambda s: s.mechanism.run(**s.places, static=True, on_gap="mark"),
    "without friction": lambda s: s.mechanism.run(**s.places, friction="none", on_gap="mark"),
    "successive": lambda s: s.mechanism.run(**s.places, friction="successive", on_gap="mark"),
    "one sample": lambda s: s.mechanism.run(at=s.pose),
    "at rest": lambda s: s.mechanism.simulate(
        MOVES, start={d: (q, 0.0) for d, q in s.pose.items()}, budget=BUDGET
    ),
    "steady": lambda s: s.mechanism.simulate("steady", budget=1.0),
    "until it stands": lambda s: s.mechanism.simulate(
        "time=0.2", method=bm.FixedStep("rk4", 0.01), budget=BUDGET
    ),
    "trade of a motion": lambda s: s.mechanism.trade("simulate", budget=0.05, until="time=0.01"),
    "study in a folder": _study_out,
    "study of motions": _study_of_motions,
    "verify a motion": lambda s: s.mechanism.verify(s.motion),
    "stroke of a run": _each(lambda m, name: m.run(samples=SAMPLES, want=name).stroke(name)),
    "tables": lambda s: [
        s.result.to_csv(),
        s.result.to_dataframe().shape,
        s.result.to_xarray().sizes,
        s.result._judged,
        s.result.notes(),
    ],
    "tables of a motion": lambda s: [s.motion.to_csv(), s.motion.notes()],
    "mode shapes": _modes_shown,
    "replace": _replaced,
    "pickle": lambda s: pickle.loads(pickle.dumps([s.document, s.mechanism, s.result])),
}


def _into(folder: Callable[[Subject, Path], Any]) -> Call:
    """A call that writes into a folder, which goes afterwards."""

    def call(s: Subject) -> None:
        with tempfile.TemporaryDirectory() as home:
            folder(s, Path(home))

    return call


def _written(name: str) -> Call:
    suffix = WRITERS[name].suffixes[0] if WRITERS[name].suffixes else ""
    poses = name in ("csv", "json", "npz", "parquet", "xlsx", "mat", "page", "report", "svg", "dxf")
    return _into(
        lambda s, home: bm.write(
            s.mechanism, home / f"it{suffix}", name, **(s.places if poses else {})
        )
    )


def _drawn(kind: str) -> Call:
    def call(s: Subject, home: Path) -> None:
        suffix = ".html" if kind == "animation" else ".svg"
        want = s.links[:1] if kind == "centrodes" else "*"
        at = s.places.get("at") if kind in ("mechanism", "animation", "centrodes") else None
        draw(s.document, home / f"it{suffix}", kind, at, want=want)  # type: ignore[arg-type]

    return _into(call)


PICTURES: dict[str, Call] = {
    "diagram_svg": lambda s: svg(draw(s.mechanism, kind="diagram")),
    "mechanism_svg": lambda s: svg(draw(s.document, None, "mechanism", s.pose)),
    "run_pictures": _into(lambda s, home: run_pictures(s.result, home)),
    "plot": _into(lambda s, home: plot(s.result, home / "it.svg", s.output)),
    "plot of a motion": _into(lambda s, home: plot(s.motion, home / "it.svg", s.motion)),
    "motion_svg": lambda s: motion_svg(s.motion),
    "film of a motion": _into(lambda s, home: animate(s.motion, home / "it.html")),
    "film": _into(lambda s, home: animate(s.document, home / "it.gif", **_film(s))),
}


def _film(s: Subject) -> dict[str, Any]:
    return {"at": s.places["at"]} if "at" in s.places else {}


def _commands() -> dict[str, Call]:
    from blockmech.cli import COMMANDS

    lines = {
        "trade": ["--budget", "0.05"],
        "simulate": ["--until", MOVES],
        "sweep": ["{number}={value},{value}", "--want", "max_abs({output})"],
        "sensitivity": ["--want", "{output}"],
        "solutions": [],
        "extremes": ["{output}"],
        "draw": ["-o", "{home}/it.svg"],
        "export": ["-o", "{home}/it.csv"],
        "page": ["-o", "{home}/it.html"],
        "report": ["-o", "{home}/it.html"],
        "balance": ["{number}"],
        "identify": [],
    }
    apart = {"studio", "new", "import_", "blocks", "schema", "identify", "test"}
    names = [function.__name__ for function in COMMANDS if function.__name__ not in apart]
    return {f"blockmech {name}": partial(_commanded, name, lines.get(name, [])) for name in names}


def _commanded(name: str, options: list[str], s: Subject) -> None:
    from blockmech.cli import main
    from blockmech.cli.terminal import FAULT

    with tempfile.TemporaryDirectory() as home:
        number, value = next(iter(s.numbers.items()), ("", 0.0))
        values = {"home": home, "output": s.output, "number": number, "value": repr(value)}
        arguments = [name, s.document.file, *(word.format(**values) for word in options)]
        out, err = StringIO(), StringIO()
        with redirect_stdout(out), redirect_stderr(err):
            code = main(arguments)
        if code == FAULT:
            raise RuntimeError(err.getvalue())
        assert "Traceback" not in err.getvalue()
        _words(out.getvalue())


CALLS: dict[str, Call] = {
    **METHODS,
    **MORE,
    **{f"write {name}": _written(name) for name in WRITERS},
    **{f"draw {kind}": _drawn(kind) for kind in KINDS},
    **PICTURES,
    **_commands(),
}


class Fault(NamedTuple):
    """What may not come of a call."""

    call: str
    kind: str
    detail: str


def faults(s: Subject, name: str) -> list[Fault]:
    """What a call does that it may not: other exceptions, warnings, numbers that are none."""
    found = []
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            for detail in shows(CALLS[name](s)):
                found.append(Fault(name, "nan", detail))
        except bm.BlockmechError as error:
            try:
                refusal(error)
            except AssertionError as why:
                found.append(Fault(name, "words", str(why)))
        except Exception:
            found.append(Fault(name, "traceback", traceback.format_exc()))
    said = sorted({f"{w.filename}:{w.lineno}: {w.message}" for w in warned})
    return found + [Fault(name, "warning", text) for text in said]


def refusal(error: bm.BlockmechError) -> None:
    """An error of ours says what was found, in signs that can be shown."""
    for problem in error.problems:
        assert all((problem.code, problem.found, str(problem).isprintable())), repr(problem)
        assert not re.search(r"\bnan\b", str(problem)), str(problem)


def shows(answer: Any) -> Iterator[str]:
    """Numbers that are none where an answer shows itself: in words, JSON, a notebook, a picture."""
    if isinstance(answer, list | tuple) and not hasattr(answer, "_asdict"):
        for part in answer:
            yield from shows(part)
    if isinstance(answer, Result):
        json.dumps(answer.to_dict(), allow_nan=False)
        str(answer), repr(answer), answer._repr_html_()
        yield from silent(answer)
    if isinstance(answer, Facts):
        json.dumps(answer.to_dict(), allow_nan=False)
    if isinstance(answer, Report):
        yield from _words(answer.text()) or ()
        yield from _words(answer.to("deg").text()) or ()
        answer._repr_html_()
        pickle.loads(pickle.dumps(answer))
    if isinstance(answer, Pictured):
        try:
            answer.figure()
        except bm.BlockmechError as error:
            refusal(error)


def _words(text: str) -> list[str]:
    """Lines in which ``nan`` stands for a number."""
    return [line for line in text.splitlines() if re.search(r"\bnan\b", line)][:3]


def silent(result: Result) -> Iterator[str]:
    """Outputs that hold a number that is none in a sample with an answer."""
    good = np.array([status == OK for status in result.quality.status])
    infinite = {flag.where for flag in result.quality.flags if flag.code == "infinite"}
    for name in result:
        if result._output(name).kind == "number" or name in infinite:
            continue
        values = np.asarray(result[name])
        if len(values) == len(good) and not np.isfinite(values[good]).all():
            yield name
