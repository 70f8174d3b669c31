"""``blockmech new`` and ``studio``: where to begin, with a copy of the gallery or in a browser."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from blockmech.cli.terminal import say
from blockmech.editor import service
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


def studio(
    file: Annotated[
        str | None, typer.Argument(metavar="[FILE]", help="A file of this folder.")
    ] = None,
    port: Annotated[int, typer.Option(help="Port; by default a free one.", min=0, max=65535)] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address, open nothing.")
    ] = False,
) -> None:
    """Open the studio in the browser: the gallery, or the sheet of FILE.

    The server answers this machine only, and touches no file outside the current folder.
    """

    def open_page(address: str) -> None:
        say(address)
        if not no_browser:
            import webbrowser  # few calls need it

            webbrowser.open(address)

    run = service().started(Path.cwd(), file, port, open_page)
    say("Ctrl-C ends it")
    run()
