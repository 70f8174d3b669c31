"""``blockmech export``: a mechanism, or what it computes, as a file of another program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from blockmech.builders import compiled_of, opened
from blockmech.cli.options import Friction, GraphFile, Poses, Static, Want, names_of, option
from blockmech.cli.terminal import progress_bar, reading, say
from blockmech.ground.errors import refused
from blockmech.ground.runnable import EVERYTHING


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
    from blockmech.exchange.formats import WRITERS, writer_for
    from blockmech.exchange.writing import write

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
    document = reading(file, opened)
    mechanism = compiled_of(document, file)
    if output is None:
        if to is None:
            raise refused("export", "no file to write is named", "add -o FILE, or --to FORMAT")
        output = f"{mechanism.name}{writer_for(Path(), to).suffixes[0]}"
    request = poses.of(mechanism) | {"friction": friction, "static": static or None}
    with progress_bar("writing"):
        files = write(
            document, output, to, want=names_of(want) or EVERYTHING, **request, **_options(set_)
        )
    say("\n".join(f"wrote {path}" for path in files))


def _options(texts: list[str] | None) -> dict[str, str]:
    options = {}
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not equals:
            raise refused(f"--set {text}", "it has no value", "write NAME=VALUE")
        options[name] = value
    return options
