"""``blockmech new``: start from a copy of a mechanism of the gallery."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from blockmech.cli.terminal import say
from blockmech.ground.errors import among, refused
from blockmech.ground.files import writing
from blockmech.testing.graph_files import gallery


def new(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="A graph of the gallery.")
    ] = None,
    file: Annotated[str | None, typer.Argument(metavar="FILE", help="The file to make.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Copy a gallery graph to FILE, or list the gallery if no name is given."""
    graphs = gallery()
    if name is None:
        say("\n".join(graphs) or "the gallery is empty")
        return
    among(graphs, "graph", name, where="gallery")
    if file is None:
        raise refused(name, "no file to write is named", f"blockmech new {name} {name}.json")
    if os.path.exists(file) and not force:
        raise refused(file, "the file exists", "choose another name, or add --force")
    with writing(file) as stream:
        stream.write(graphs[name].read_bytes())
    say(f"wrote {file}")
