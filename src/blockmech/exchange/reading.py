"""Read a linkage from a file, an address or an object of another tool.

At a dead centre a drawing does not tell the assembly mode, for two meet. So a joint that nothing
drives is moved a little from the drawn pose, and where all links stand then tells it. Where slots
are all but singular, places that are rounded close as they are drawn or not at all.
"""

from __future__ import annotations

import codecs
import math
import os
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

from blockmech.exchange import pylinkage
from blockmech.exchange.drawing import STEP, UNITS
from blockmech.exchange.drawn_linkage import document
from blockmech.exchange.formats import READERS, Reader
from blockmech.exchange.parsing import wrong
from blockmech.ground.errors import (
    BlockmechError,
    FormatError,
    GraphError,
    Problem,
    among,
    in_file,
    refused,
)
from blockmech.ground.limits import LARGEST, SOLVED
from blockmech.typing import Data

BAD_CONTENT = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
"""What readers stumble over in a text that no tool has written."""
DECLARED = re.compile(rb"""\s*<\?xml[^>]*?\sencoding\s*=\s*["']([\w.:-]+)""")
ADDRESS = ("http://", "https://")


def imported(
    source: Any, unit: str | None = None, format: str | None = None, rounded: bool = False
) -> Data:
    """The joint-based document of what another tool wrote, its notes among it.

    ``source`` is a file's name, an address, a text, or a live object of pylinkage. Points that
    slide are on their lines, or if ``rounded`` beside them as they are drawn. Raises `FormatError`
    for what cannot be read, `RequestError` for units and formats that are none.
    """
    among(UNITS, "unit", unit or (), where="unit")
    if pylinkage.is_live(source):
        return document(pylinkage.of_object(source), unit, rounded)
    text, name = _text(source)
    try:
        short = os.path.splitext(os.path.basename(name))[0] if len(name) < 200 else "address"
        return document(_reader(text, name, format).read(text, short), unit, rounded)
    except FormatError as error:
        raise FormatError(in_file(error.problems, name)) from None
    except BAD_CONTENT as error:
        message = f"it is not written as its tool writes files: {error}"
        remedy = "save it again there, or tell us if the tool reads it"
        raise wrong(name, message, "", remedy) from error
    except RecursionError:
        raise wrong(name, "some of its parts depend on each other in a circle") from None


def _text(source: Any) -> tuple[str, str]:
    """The text, and what it is called in messages."""
    if not isinstance(source, str | os.PathLike):
        message = f"got {type(source).__name__}"
        raise refused("read", message, valid="a file's name, an address, or an object of pylinkage")
    name = os.fspath(source)
    if name.lower().startswith(ADDRESS):
        return name, "address"
    with suppress(OSError, ValueError):
        if os.path.isfile(name):
            return _of_file(name), name
    for key in READERS:
        if len(name) > 20 and READERS[key].recognises(name):
            return name, "text"
    message, remedy = "no such file", "check the name"
    if os.path.isdir(name):
        message = "it is a folder"
        remedy = "name a file in it; parts of a study open by pandas.read_parquet(folder)"
    raise FormatError(Problem("no-file", "", message, "", remedy, file=name[:200]))


def _of_file(name: str) -> str:
    try:
        with open(name, "rb") as stream:
            raw = stream.read(LARGEST + 1)
    except OSError as error:
        message = f"it cannot be read: {(error.strerror or '').lower()}"
        raise FormatError(Problem("unreadable", "", message, file=name)) from error
    if len(raw) > LARGEST:
        raise wrong(name, f"too large: more than {LARGEST / 1e6:.0f} MB", "a drawing is shorter")
    encoding = _encoding(raw)
    try:
        text = raw.decode(encoding)
    except LookupError:
        message = f'no encoding of texts is called "{encoding}"'
        raise wrong(name, message, "UTF-8", "save it as UTF-8") from None
    except UnicodeDecodeError as error:
        message = f"byte 0x{raw[error.start]:02x} is not {encoding.upper()} text"
        raise wrong(name, message, "UTF-8", "save it as UTF-8") from None
    if not text.strip() or "\0" in text:
        raise wrong(name, "it is empty" if not text.strip() else "it is no text", "a drawing")
    return text


def _encoding(raw: bytes) -> str:
    """The encoding of a file's bytes: by their first ones, else by what XML says of itself."""
    marks = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16"}
    marks |= {codecs.BOM_UTF16_BE: "utf-16", b"<\0": "utf-16-le", b"\0<": "utf-16-be"}
    if (encoding := next((e for mark, e in marks.items() if raw.startswith(mark)), None)) is None:
        head = DECLARED.match(raw)
        encoding = head[1].decode() if head else "utf-8"
    return encoding


def _reader(text: str, name: str, format: str | None) -> Reader:
    if format is not None:
        return READERS.named(format, "format")
    for key in READERS:
        if READERS[key].recognises(text):
            return READERS[key]
    formats = ", ".join(READERS)
    raise wrong("", "no format that is read looks like this", f"formats: {formats}")


def beyond(linkage: Any, rounded: Callable[[], Any]) -> Any:
    """A `blockmech.Linkage` itself, or where it stands at a dead centre, one that stands beside."""
    codes = _problems(linkage)
    if "does-not-close" in codes:  # by the rounding of slots that are all but singular
        linkage = rounded()
        codes = _problems(linkage)
    if "dead-centre" not in codes:
        return linkage
    data = linkage.to_data()
    for driver, joint, step in _trials(data):
        drivers = {**data["drivers"], driver: {"joint": joint}}
        changes = {"drivers": drivers, "couplings": {}, "stops": {}, "loads": {}}
        try:
            trial = type(linkage).from_data({**data, **changes})
            starts = dict.fromkeys(drivers, 0.0) | {driver: step}
            pose = trial.run(at=starts, want=["link.*.p", "link.*.angle"], static=True)
        except BlockmechError:
            continue
        links = {name: dict(link) for name, link in data["links"].items()}
        for name in links:
            z, angle = complex(pose[f"link.{name}.p"][0]), float(pose[f"link.{name}.angle"][0])
            links[name]["pose"] = [z.real, z.imag, angle]
        note = f"it is drawn at a dead centre of {driver}: read with {joint} moved by {step:.3g}"
        notes = [*data.get("notes", []), f"{note}, which tells the mode; poses say the other one"]
        bent = type(linkage).from_data({**data, "links": links, "notes": notes})
        if "dead-centre" not in _problems(bent):
            return bent
    return linkage


def _problems(linkage: Any) -> set[str]:
    """Codes of what is wrong with a linkage."""
    try:
        linkage.decompose()
    except GraphError as error:
        return {problem.code for problem in error.problems}
    return set()


def _trials(data: Data) -> Iterator[tuple[str, str, float]]:
    """A driver, the joint that moves in its place, and by how much [rad or m]."""
    driven = {driver["joint"] for driver in data["drivers"].values()}
    points = [complex(*z) for joint in data["joints"].values() for z in joint["at"]]
    size = max(abs(z - points[0]) for z in points)
    movable = ((name, x) for name, x in data["joints"].items() if x["type"] != "weld")
    joints = [(name, joint) for name, joint in movable if name not in driven]
    joints.sort(key=lambda x: (x[1]["type"] == "P", x[1]["type"], "frame" not in x[1]["links"]))
    for name, joint in joints[:SOLVED]:
        step = STEP * (size if joint["type"] == "P" else 1.0)
        for driver in data["drivers"]:
            yield from ((driver, name, math.copysign(step, sign)) for sign in (1, -1))
