"""The options that commands share, and what does not go together.

Options that belong together are a dataclass: a command takes it as one argument, and `flat`
gives typer its fields.
"""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer

from blockmech.cli.numbers import MOST, coordinates, number_in, times
from blockmech.ground.errors import close_match, listed, refused
from blockmech.result.samples import DEFAULT_SAMPLES
from blockmech.testing.graph_files import gallery
from blockmech.typing import Data, MotionName, Successive

if TYPE_CHECKING:
    from blockmech.compiled import Compiled


def option(help: str, metavar: str | None = None, **settings: Any) -> Any:
    """An option with a value."""
    return typer.Option(help=help, metavar=metavar, **settings)


def number_of(name: str, *units: str) -> Callable[[str], float]:
    """What reads an option's number, which may end in a unit of these kinds: 2kN, 5ms."""

    def read(text: str) -> float:
        return number_in(f"--{name} {text}", str(text), *units)

    read.__name__ = "number"
    return read


def switch(name: str, help: str) -> Any:
    """An option without a value."""
    return typer.Option(f"--{name}", help=help)  # named, or typer adds --no-name


Degrees = Annotated[
    bool | None,
    typer.Option(
        "--deg/--rad",
        help="Angles in degrees or radians, also coordinates typed without a unit; "
        "by default degrees in pictures alone.",
    ),
]


def of_gallery(name: str) -> str:
    """The file of a gallery mechanism that is named without a path; other names as they are."""
    word = name.removesuffix(".json")
    if not word or os.path.exists(name) or Path(word).suffix:
        return name
    gallery_files = gallery()
    if word in gallery_files:
        return str(gallery_files[word])
    alike = [f'did you mean "{x}"?' for x in gallery_files if x.startswith(word)]
    if remedy := close_match(word, gallery_files) or (alike or [""])[0]:
        raise refused(name, "no such file, and nothing of that name in the gallery", remedy)
    return name


def _like(incomplete: str) -> list[str]:
    """Gallery names that begin so, for a shell that completes a word."""
    return [name for name in gallery() if name.startswith(incomplete)]


FILE_OR_NAME: Data = {"metavar": "FILE", "callback": of_gallery, "autocompletion": _like}
GraphFile = Annotated[
    str,
    typer.Argument(
        help="A graph of blocks, or links and joints (JSON); or a name of the gallery.",
        **FILE_OR_NAME,
    ),
]


def flat(command: Callable[..., None]) -> Callable[..., None]:
    """A command with each group of options spread out into its fields, as typer takes them."""
    hints = get_type_hints(command, include_extras=True)
    parameters: list[inspect.Parameter] = []
    groups: Data = {}
    for p in inspect.signature(command).parameters.values():
        group = hints[p.name]
        if not is_dataclass(group):
            parameters.append(p.replace(annotation=group, kind=p.KEYWORD_ONLY))
            continue
        groups[p.name] = group
        inner = get_type_hints(group, include_extras=True)
        parameters += [
            inspect.Parameter(f.name, p.KEYWORD_ONLY, default=f.default, annotation=inner[f.name])
            for f in fields(group)
        ]

    @functools.wraps(command)
    def spread(**arguments: Any) -> None:
        groups_of_options = {
            name: group(**{f.name: arguments.pop(f.name) for f in fields(group)})
            for name, group in groups.items()
        }
        command(**arguments, **groups_of_options)

    spread.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    spread.__annotations__ = {p.name: p.annotation for p in parameters}
    return spread


At = Annotated[
    list[str] | None,
    option(
        "Driver coordinates, e.g. 0,1,60deg, 0:360deg:37 or 0..360deg; once for each driver.",
        "[DRIVER=]NUMBERS",
    ),
]
Samples = Annotated[
    int | None,
    option("Samples of the file's range, or of A..B (361).", "N", min=1, max=MOST),
]
Times = Annotated[
    str | None, typer.Option("--times", metavar="TIMES", help="Times [s], e.g. 0:2:201.")
]
Want = Annotated[
    list[str] | None, option('Outputs or patterns, e.g. crank.drive,"*.reaction".', "A,B")
]
Friction = Annotated[str | None, option("none, single, successive or newton.", "METHOD")]
Tolerance = Annotated[
    float | None,
    option(
        "Stop of successive approximations [N], e.g. 1mN.", "X", parser=number_of("tolerance", "N")
    ),
]
Iterations = Annotated[int | None, option("Fixed number of successive approximations.", "K")]
Static = Annotated[bool, switch("static", "Leave inertia out.")]
Explain = Annotated[bool, switch("explain", "Only show what would be computed.")]
AsJson = Annotated[bool, switch("json", "Print as JSON.")]
DisplayUnits = Annotated[
    list[str] | None, option("Units of texts, tables and CSV, e.g. mm,rpm,kN.", "UNITS")
]


@dataclass(frozen=True)
class Poses:
    """Where the drivers stand."""

    at: At = None
    samples: Samples = None
    at_times: Times = None

    def of(self, mechanism: Compiled, degrees: bool | None = None) -> Data:
        """The arguments at, samples and times of a run."""
        ranged = any(".." in text for text in self.at or ())  # has as many samples as are asked for
        at = coordinates(mechanism, self.at, degrees, self.samples or DEFAULT_SAMPLES)
        samples = None if ranged else self.samples
        return {"at": at, "samples": samples, "times": times(self.at_times)}


@dataclass(frozen=True)
class FrictionOptions:
    """How joint friction is solved."""

    friction: Friction = None
    tolerance: Tolerance = None
    iterations: Iterations = None

    @property
    def method(self) -> Any:
        """The friction of a run; ``successive`` with what stops it."""
        if self.tolerance is None and self.iterations is None:
            return self.friction
        if self.friction != "successive":
            names = [f"--{x}" for x in ("tolerance", "iterations") if getattr(self, x) is not None]
            message = f"has no meaning for friction {self.friction or 'newton'}"
            remedy = "use --friction successive with it"
            raise refused(listed(names), message, remedy, code="useless-setting")
        return Successive(self.tolerance, self.iterations)


def names_of(want: list[str] | None) -> tuple[str, ...]:
    """Names and patterns from options that take several, e.g. ``--want``."""
    return tuple(n for part in want or () for n in part.split(",") if n)


def at_most_one(**options: bool) -> None:
    """Refuse two ways of output at a time."""
    chosen = [f"--{name}" for name, on in options.items() if on]
    if len(chosen) > 1:
        raise refused(" ".join(chosen), "only one of them at a time", "--out writes all files")


# of motions
Until = Annotated[
    str | None,
    option(
        "standstill, swings=3, turns=3, time=2, angle=6.28 or steady (what it settles to); "
        "of several, e.g. standstill,time=2, whichever is met first.",
        "GOAL",
    ),
]
Start = Annotated[
    list[str] | None,
    option(
        "Coordinate and rate at the start, e.g. crank=60deg or crank=1.2,-3 (rate 0 if left out); "
        "once for each driver, the others start as the scene says.",
        "[DRIVER=]Q[,RATE]",
    ),
]
Prescribed = Annotated[
    list[str] | None,
    option("A driver that follows its law of motion; once for each.", "DRIVER"),
]
Locked = Annotated[
    list[str] | None,
    option("A driver that is held at a coordinate, e.g. knee=30deg; once for each.", "DRIVER=Q"),
]
Method = Annotated[
    str,
    option(f"{', '.join(get_args(MotionName))}.", "METHOD"),
]
Accuracy = Annotated[
    float | None,
    option("Target error of the driver [rad or m].", "X", parser=number_of("accuracy", "rad", "m")),
]
