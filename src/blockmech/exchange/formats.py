"""Formats by name, and what writes in one: blockmech's own, and those of installed packages.

An outside package names an object in the entry-point group ``blockmech.readers`` or
``blockmech.writers``, under the format's name: a `Writer`, or a `Reader`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, wraps
from pathlib import Path
from pkgutil import resolve_name
from typing import IO, TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from blockmech.compiled import Compiled
from blockmech.exchange.drawing import Drawing
from blockmech.ground.arguments import declared
from blockmech.ground.errors import (
    RequestError,
    among,
    as_names,
    refused,
    shown,
    unknown_name,
)
from blockmech.ground.files import AnyPath, refuse_spared, spare, sparing, writing
from blockmech.ground.runnable import EVERYTHING, Runnable
from blockmech.ground.units import NoQuantity, quantity
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.typing import Arguments, Record

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


@dataclass(frozen=True)
class Order:
    """What is to be written: a mechanism, and what of it.

    Attributes
    ----------
    want : outputs, names or patterns
    at : poses to be written or computed, as ``at``, ``samples`` or ``times`` of a run
    settings : friction, static of a run
    options : what one format alone asks for, e.g. ``real="float"``
    computed : the wanted outputs at these poses, where somebody has them already
    """

    mechanism: Compiled
    want: tuple[str, ...] = EVERYTHING
    at: Record = field(default_factory=dict)
    settings: Arguments = field(default_factory=dict)
    options: Arguments = field(default_factory=dict)
    computed: Result | None = None

    def samples(self) -> Samples | None:
        """The poses that are asked for; None where nothing says which."""
        coordinates = (self.at.get(key) for key in ("at", "samples", "times"))
        return self.mechanism.samples(*coordinates, None, None) if self.at else None

    def result(self) -> Result:
        """The wanted outputs, samples without an answer marked."""
        if self.computed is not None:
            return self.computed
        return self.mechanism.run(**self.at, want=self.want, **self.settings, on_gap="mark")

    def positive(self, name: str, default: float, unit: str, example: str) -> float:
        """A number above 0 among the options, in SI or as text with its unit.

        Raises `RequestError` for anything else.
        """
        raw = self.options.get(name, default)
        with suppress(NoQuantity):
            if (x := quantity(str(raw), unit)) > 0:
                return x
        remedy = f"write for example {example}"
        raise refused(name, f"got {shown(raw)}", remedy, "a number above 0")


class Writer(NamedTuple):
    """A format that is written.

    about : what it is, in a few words
    suffixes : ends of file names, the usual one first
    write : (order, path) -> the files that were written, e.g. by `file_writer`
    options : what it takes beside outputs and poses: name -> what that is
    """

    about: str
    suffixes: tuple[str, ...]
    write: Callable[[Order, Path], list[Path]]
    options: Mapping[str, str] = {}


def file_writer(fill: Callable[[Order, IO[bytes]], object]) -> Callable[[Order, Path], list[Path]]:
    """The ``write`` of a format of one file, from what fills its stream; whole or not at all."""

    @wraps(fill)
    def write(order: Order, path: Path) -> list[Path]:
        with writing(path) as stream:
            fill(order, stream)
        return [path]

    return write


class Reader(NamedTuple):
    """A format that is read.

    about : what it is, in a few words
    suffixes : ends of file names
    recognises : whether a text looks like it
    read : (text, name for messages) -> the drawing; raises `FormatError`
    """

    about: str
    suffixes: tuple[str, ...]
    recognises: Callable[[str], bool]
    read: Callable[[str, str], Drawing]


T = TypeVar("T")


class Formats(Generic[T], Mapping[str, T]):
    """Formats of one direction, each loaded when it is first asked for."""

    def __init__(self, group: str, builtin: Mapping[str, str]) -> None:
        """``builtin`` has the format's name and the place of its object, ``"module:name"``."""
        self.group, self._builtin = group, builtin
        self._formats: dict[str, T] = {}

    @cached_property
    def _outside(self) -> dict[str, EntryPoint]:
        """Formats of packages, by names that no built-in one has."""
        from importlib.metadata import entry_points

        points = entry_points(group=self.group)
        return {point.name: point for point in points if point.name not in self._builtin}

    def __getitem__(self, name: str) -> T:
        if name not in self._formats and name in self._builtin:
            self._formats[name] = resolve_name(self._builtin[name])
        if name not in self._formats:
            point = self._outside[name]
            try:
                self._formats[name] = point.load()
            except Exception as error:
                message = f"the package {point.value} failed to load: {error}"
                remedy = "repair or uninstall it"
                raise refused(name, message, remedy, code="broken-plugin") from error
        return self._formats[name]

    def named(self, name: str, where: str) -> T:
        """A format. Raises `RequestError` for a name that is none."""
        if name not in self:  # else those of other packages are not looked for
            among(self, "format", name, where=where)
        return self[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*self._builtin, *self._outside))

    def __len__(self) -> int:
        return len(self._builtin) + len(self._outside)


WRITERS: Formats[Writer] = Formats(
    "blockmech.writers",
    {
        "c": "blockmech.exchange.c.program:WRITER",
        "fmu": "blockmech.exchange.fmu.files:WRITER",
        "mjcf": "blockmech.exchange.mjcf:WRITER",
        "address": "blockmech.exchange.addresses:WRITER",
        "dxf": "blockmech.exchange.outlines:DXF",
        "svg": "blockmech.exchange.outlines:SVG",
        "xlsx": "blockmech.exchange.tables:XLSX",
        "mat": "blockmech.exchange.tables:MAT",
        "csv": "blockmech.exchange.tables:CSV",
        "json": "blockmech.exchange.tables:JSON",
        "npz": "blockmech.exchange.tables:NPZ",
        "parquet": "blockmech.exchange.tables:PARQUET",
        "page": "blockmech.exchange.page.files:WRITER",
        "report": "blockmech.exchange.report:WRITER",
        "picture": "blockmech.exchange.outlines:PICTURE",
        "film": "blockmech.exchange.outlines:FILM",
    },
)
"""Formats that are written."""

READERS: Formats[Reader] = Formats(
    "blockmech.readers",
    {
        "pmks+": "blockmech.exchange.pmks_plus:READER",
        "pmks": "blockmech.exchange.pmks:TEXT",
        "pmks-json": "blockmech.exchange.pmks:JSON",
        "pyslvs": "blockmech.exchange.pmks:EXPRESSION",
        "linkage": "blockmech.exchange.linkage2:READER",
        "pylinkage": "blockmech.exchange.pylinkage:READER",
        "mjcf": "blockmech.exchange.mujoco:READER",
        "asmt": "blockmech.exchange.asmt:READER",
        "urdf": "blockmech.exchange.robots:URDF",
        "sdf": "blockmech.exchange.robots:SDF",
        "dxf": "blockmech.exchange.sketches:DXF",
        "svg": "blockmech.exchange.sketches:SVG",
    },
)
"""Formats that are read, in the order in which they are tried."""


def writer_for(path: Path, to: str | None) -> Writer:
    """The writer that a format's name asks for, or else the suffix of the file.

    Raises `RequestError` for what nobody writes.
    """
    if to is None and path.name in WRITERS:  # e.g. "address" alone
        to = path.name
    if to is not None:
        return WRITERS.named(to, "--to")
    suffix = path.suffix.lower()
    if writer := next((x for x in WRITERS.values() if suffix in x.suffixes), None):
        return writer
    suffixes = ", ".join(f"{WRITERS[n].suffixes[0]} ({n})" for n in WRITERS)
    message = f'no format has the suffix "{suffix}"' if suffix else "the name has no suffix"
    raise refused(str(path), message, 'name the format, e.g. to="csv"', f"suffixes: {suffixes}")


POSES = ("at", "samples", "times")
SETTINGS = ("friction", "static")


@declared
def write(
    subject: Runnable | Result,
    path: AnyPath,
    to: str | None = None,
    *,
    want: Iterable[str] | str = EVERYTHING,
    **options: Any,
) -> list[Path]:
    """Write a mechanism, or a result, as a file of another program, e.g. C text.

    Parameters
    ----------
    subject : a graph, a linkage or a compiled mechanism; or a result, in its units
    path : the file, or for some formats the folder; whole or not at all
    to : the format's name; by default the suffix says it
    want : outputs, for formats that have numbers in them
    options : of a mechanism ``at``, ``samples``, ``times``, ``friction``, ``static``
        as `Mechanism.run` takes them; and the format's own options, e.g. ``real="float"``

    Returns
    -------
    The files that were written.

    Raises
    ------
    RequestError for an unknown format or option, for the file that the mechanism was read from, and
    for features of the mechanism that the format cannot express

    >>> bm.write(g, "fourbar.c", want="crank.drive")
    [PosixPath('fourbar.h'), PosixPath('fourbar.c'), PosixPath('fourbar_test.c')]
    """
    path = Path(path)
    writer = writer_for(path, to)
    if isinstance(subject, Result):
        poses = {d: subject.samples.coordinate(i) for i, d in enumerate(subject.mechanism.drivers)}
        computed, mechanism = subject, subject._compiled
        of_run, want = {"at": poses, **subject.settings}, tuple(subject)
    else:
        computed, mechanism = None, subject.compile()
        of_run = {k: options.pop(k, None) for k in (*POSES, *SETTINGS)}
    remedy = 'poses and units are those of a result: write(m.run(...).to("mm", "deg"), "run.csv")'
    RequestError.raise_for(
        unknown_name("bad-request", "option", name, name, writer.options, remedy, " of this format")
        for name in options
        if name not in writer.options
    )
    order = Order(
        mechanism,
        as_names("want", want),
        {k: of_run[k] for k in POSES if of_run.get(k) is not None},
        {k: of_run[k] for k in SETTINGS if of_run.get(k) is not None},
        {k: v for k, v in options.items() if v is not None},
        computed,
    )
    with sparing():
        if mechanism.document is not None and mechanism.document.file:
            spare(mechanism.document.file)
        refuse_spared(path)
        return writer.write(order, path)
