"""``blockmech sensitivity``: what each number of a mechanism does to its outputs."""

from __future__ import annotations

from typing import Annotated

from blockmech.builders import compiled
from blockmech.cli.options import Friction, GraphFile, Poses, Static, names_of, option
from blockmech.cli.output import TableDisplay
from blockmech.ground.runnable import EVERYTHING
from blockmech.typing import Arguments

Wants = Annotated[list[str], option('Outputs or patterns, e.g. crank.drive,"*.reaction".', "A,B")]
To = Annotated[
    list[str] | None,
    option('Numbers or patterns, e.g. "dyad.l_*",crank.q; by default all numbers.', "A,B"),
]


def sensitivity(
    file: GraphFile,
    want: Wants,
    poses: Poses,
    display: TableDisplay,
    to: To = None,
    friction: Friction = None,
    static: Static = False,
) -> None:
    """Rank the parameters of a mechanism by their influence on outputs, from exact derivatives."""
    settings: Arguments = {
        "to": names_of(to) or EVERYTHING,
        "friction": friction,
        "static": static,
    }
    outputs = names_of(want)
    display.answer_command(
        file,
        compiled,
        "differentiating",
        lambda m: m.sensitivity(outputs, **poses.of(m, display.deg), **settings),
    )
