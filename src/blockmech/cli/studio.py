"""``blockmech studio``: draw and wire mechanisms in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from blockmech.cli.terminal import say
from blockmech.editor import service


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
