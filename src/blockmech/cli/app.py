"""The typer application: the commands and the options that all of them share."""

from __future__ import annotations

from typing import Annotated, Any

import typer

import blockmech
from blockmech.cli.analyses import check, extremes, limits, modes, verify
from blockmech.cli.decompose import decompose
from blockmech.cli.describe import blocks, schema
from blockmech.cli.draw import draw
from blockmech.cli.new import new
from blockmech.cli.run import run
from blockmech.cli.simulate import simulate
from blockmech.cli.terminal import say
from blockmech.cli.test import test
from blockmech.cli.trade import trade

COMMANDS = (
    *(run, simulate, check, decompose, draw, verify, limits, modes, extremes, trade),
    *(test, new, blocks, schema),
)


def command() -> Any:
    """The whole application as one command that can be called."""
    app = typer.Typer(
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_shared)
    for function in COMMANDS:
        app.command()(function)
    return typer.main.get_command(app)


def _version(asked: bool) -> None:
    if asked:
        say(f"blockmech {blockmech.__version__}")
        raise typer.Exit


def _shared(
    version: Annotated[
        bool,
        typer.Option("--version", help="Show the version.", is_eager=True, callback=_version),
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show the traceback of an error, anywhere.")
    ] = False,
) -> None:
    """Planar mechanisms as block diagrams: run, simulate, check and draw a graph file."""
    # --debug is read by `main`, which also takes it after the command.
