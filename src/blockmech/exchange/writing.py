"""Write a mechanism, or what it computes, as a file of another program."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from blockmech.exchange.formats import Order, writer_for
from blockmech.ground.arguments import declared
from blockmech.ground.errors import among, as_names
from blockmech.ground.files import AnyPath, refuse_spared, spare, sparing
from blockmech.ground.runnable import EVERYTHING, Runnable

POSES = ("at", "samples", "times")
SETTINGS = ("friction", "static")


@declared
def write(
    subject: Runnable,
    path: AnyPath,
    to: str | None = None,
    *,
    want: Iterable[str] | str = EVERYTHING,
    **options: Any,
) -> list[Path]:
    """Write a mechanism as a file of another program, e.g. C text.

    Parameters
    ----------
    subject : a graph, a linkage or a compiled mechanism
    path : the file, or for some formats the folder; whole or not at all
    to : the format's name; by default the suffix says it
    want : outputs, for formats that have numbers in them
    options : ``at``, ``samples``, ``times``, ``friction``, ``static``
        as `Mechanism.run` takes them, and the format's own options, e.g. ``real="float"``

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
    mechanism = subject.compile()
    settings = {k: v for k, v in options.items() if k not in (*POSES, *SETTINGS)}
    among(writer.options, "option of this format", settings)
    order = Order(
        mechanism,
        as_names("want", want),
        {k: options[k] for k in POSES if options.get(k) is not None},
        {k: options[k] for k in SETTINGS if options.get(k) is not None},
        {k: v for k, v in settings.items() if v is not None},
    )
    with sparing():
        if mechanism.document is not None and mechanism.document.file:
            spare(mechanism.document.file)
        refuse_spared(path)
        return writer.write(order, path)
