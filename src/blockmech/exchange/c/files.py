"""The format ``c``: three files that a controller's project takes as they are."""

from __future__ import annotations

from pathlib import Path

from blockmech.exchange.c.program import CProgram, function_name, poses
from blockmech.exchange.c.statements import DOUBLE
from blockmech.exchange.formats import Order, Writer
from blockmech.ground.errors import refused
from blockmech.ground.files import refuse_spared, writing


def write_c(order: Order, path: Path) -> list[Path]:
    """``NAME.c``, ``NAME.h`` and ``NAME_test.c``, named after the file that is asked for."""
    program = CProgram(
        order.mechanism, order.want, order.options.get("real", DOUBLE), **order.settings
    )
    if path.suffix and path.suffix.lower() != ".c":
        raise refused(str(path), "C text is written to a file .c", "name it so")
    program.name = function_name(path.stem)
    samples = order.samples() or poses(order.mechanism)
    texts = {"h": program.header, "c": program.source}
    files = {path.with_name(f"{program.name}.{end}"): text for end, text in texts.items()}
    files[path.with_name(f"{program.name}_test.c")] = program.test(samples)
    refuse_spared(*files)
    for file, text in files.items():
        with writing(file) as stream:
            stream.write(text.encode("ascii", "replace"))
    return list(files)


WRITER = Writer(
    "C99 text: a function without heap or state, its header and a test program",
    (".c",),
    write_c,
    {"real": "double (default) or float, for small processors"},
)
