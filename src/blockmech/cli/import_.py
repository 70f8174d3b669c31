"""``blockmech import``: a linkage of another tool as links and joints."""

from __future__ import annotations

from typing import Annotated

import typer

from blockmech.builders import read
from blockmech.cli.options import option
from blockmech.cli.terminal import note, reading, say


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
