"""``blockmech export``, ``page``, ``report``, ``import``: files for other programs, and of them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from blockmech.builders import compiled, read
from blockmech.cli.numbers import texts_by_name
from blockmech.cli.options import Friction, GraphFile, Poses, Static, Want, names_of, option
from blockmech.cli.terminal import note, progress_bar, reading, say
from blockmech.ground.errors import refused
from blockmech.ground.runnable import EVERYTHING
from blockmech.typing import Arguments

Page = Annotated[str, typer.Option("--output", "-o", metavar="PAGE", help="The page, PAGE.html.")]


def export(
    file: GraphFile,
    poses: Poses,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FILE", help="The file to write."),
    ] = None,
    to: Annotated[
        str | None, option("The format; by default the suffix says it. list names all.", "FORMAT")
    ] = None,
    want: Want = None,
    friction: Friction = None,
    static: Static = False,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="An option of the format."),
    ] = None,
) -> None:
    """Write a mechanism, or what it computes, for another program: C, FMU, MJCF, DXF, XLSX ..."""
    from blockmech.exchange.formats import WRITERS

    if to == "list":
        raise refused("--to list", "it takes no file", "write blockmech export list")
    if file == "list":
        lines = []
        for name in WRITERS:
            writer = WRITERS[name]
            lines.append(f"{name:<10}{', '.join(writer.suffixes):<16}{writer.about}")
            lines += [f"{'':<26}--set {k}=...  {v}" for k, v in writer.options.items()]
        say("\n".join(lines))
        return
    options = dict(texts_by_name("--set", set_, "width=20mm"))
    written(file, output, to, poses, want, friction=friction, static=static or None, **options)


def written(
    file: str,
    output: str | None,
    to: str | None,
    poses: Poses,
    want: list[str] | None,
    **options: str | bool | None,
) -> None:
    """Write what a file holds in a format, by default beside its name."""
    from blockmech.exchange.formats import write, writer_for

    mechanism = reading(file, compiled)
    if output is None:
        if to is None:
            raise refused("export", "no file to write is named", "add -o FILE, or --to FORMAT")
        output = f"{mechanism.name}{writer_for(Path(), to).suffixes[0]}"
    request: Arguments = {"want": names_of(want) or EVERYTHING, **poses.of(mechanism), **options}
    with progress_bar("writing"):
        files = write(mechanism, output, to, **request)
    say("\n".join(f"wrote {path}" for path in files))


def page(
    file: GraphFile,
    output: Page,
    poses: Poses,
    want: Want = None,
    slider: Annotated[
        list[str] | None,
        option("Numbers that have a slider at first; by default a few.", "NAMES"),
    ] = None,
    friction: Friction = None,
    static: Static = False,
) -> None:
    """Write one HTML page without a server: drawing, motion, curves, sliders for numbers.

    The page computes every pose itself, with the numbers of blockmech.
    """
    settings = {"slider": ",".join(slider) if slider else None, "friction": friction}
    written(file, output, "page", poses, want, static=static or None, **settings)


def report(
    file: GraphFile,
    output: Page,
    poses: Poses,
    want: Want = None,
    friction: Friction = None,
    static: Static = False,
) -> None:
    """Write one HTML page to be printed: drawing with dimensions, data, curves, forces."""
    written(file, output, "report", poses, want, friction=friction, static=static or None)


def import_(
    source: Annotated[
        str, typer.Argument(metavar="FILE|ADDRESS", help="A file, or an address of PMKS+.")
    ],
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="DOC", help="Write the links and joints."),
    ] = None,
    unit: Annotated[
        str | None, option("Of lengths, if the file names none: m, cm, mm, in or ft.", "UNIT")
    ] = None,
    format: Annotated[
        str | None, option("pmks+, pmks, pyslvs, linkage, pylinkage ...", "FORMAT")
    ] = None,
) -> None:
    """Read a linkage of PMKS, Linkage, pylinkage, Pyslvs ... as links and joints.

    Without -o the document is printed. Notes list what was not imported.
    """
    model = reading(source, lambda text: read(text, unit=unit, format=format))
    notes = model.extras.get("notes") or []
    note(*(f"note: {text}" for text in ([notes] if isinstance(notes, str) else notes)))
    if output is None:
        say(model.to_json(), end="")
        return
    model.save(output)
    say(f"wrote {output}")


import_.__name__ = "import"  # the command's name, which Python keeps for itself
