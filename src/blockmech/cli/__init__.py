"""Command line: `main`, the border where every mistake becomes one clear message.

Exit codes: 0 done; 1 the file is fine but some wanted sample has no answer, or a
verification fails; 2 the file or the call is wrong. A fault of blockmech itself is
shown with its traceback and gives 3, Ctrl-C gives 130.
"""

from __future__ import annotations

import os
import re
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any

import typer

import blockmech
from blockmech.cli.analyses import check, extremes, limits, modes, solutions, verify
from blockmech.cli.decompose import decompose
from blockmech.cli.describe import blocks, outputs, schema
from blockmech.cli.design import balance, equilibria, identify, linearize, solve
from blockmech.cli.draw import draw
from blockmech.cli.export import export, import_, page, report
from blockmech.cli.options import flat
from blockmech.cli.run import run
from blockmech.cli.simulate import simulate
from blockmech.cli.start import new, studio
from blockmech.cli.sweep import sensitivity, sweep
from blockmech.cli.terminal import (
    DONE,
    FAULT,
    INTERRUPTED,
    NO_ANSWER,
    WRONG,
    Interrupted,
    interruptible,
    note,
    say,
)
from blockmech.cli.test import test
from blockmech.cli.trade import trade
from blockmech.ground.errors import BlockmechError, SampleError, close_match, listed
from blockmech.ground.files import sparing
from blockmech.ground.units import UnitWarning

COMMANDS = (
    *(run, simulate, check, decompose, draw, verify, limits, solutions, modes, extremes),
    *(solve, equilibria, linearize, balance, identify),
    *(trade, sweep, sensitivity, test, new, import_, export, page, report, blocks, outputs, schema),
    studio,
)

COMPLETING = "_BLOCKMECH_COMPLETE"
"""What a shell sets that asks how a line could go on: the words are not in the call then."""

GUESSES = re.compile(r"\.? \(Possible|\.? Did you mean")
"""Where a message of typer's begins to list words that are spelt alike, whatever they mean."""

FAULTY = "This is a fault of blockmech: please report it with these lines."


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and give its exit code.

    ``--debug`` may stand anywhere and shows the traceback of a user error.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # an old console shows ? for letters that it lacks
            stream.reconfigure(errors="replace")
    os.environ.pop("MPLBACKEND", None)  # pictures go to files: a window system may be unknown
    with interruptible(), sparing():
        return _run_safely(arguments)


def _warn(default: Any, message: Any, category: type[Warning], *where: Any) -> None:
    """Note what a number seems to mean; other warnings go their ``default`` way."""
    if issubclass(category, UnitWarning):
        note(str(message))
    else:
        default(message, category, *where)


def _run_safely(arguments: list[str]) -> int:
    """Run one command; every mistake becomes one message."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", UnitWarning)
            warnings.showwarning = partial(_warn, warnings.showwarning)
            return _run([w for w in arguments if w != "--debug"])
    except BlockmechError as error:
        note(traceback.format_exc() if "--debug" in arguments else str(error))
        return NO_ANSWER if isinstance(error, SampleError) else WRONG
    except MemoryError:
        note("not enough memory: ask for fewer samples or fewer outputs")
        return WRONG
    except (KeyboardInterrupt, Interrupted) as interrupt:
        note(": ".join(["interrupted", *map(str, interrupt.args)]))
        return INTERRUPTED
    except Exception:
        note(traceback.format_exc().rstrip(), FAULTY)
        return FAULT


def _run(arguments: list[str]) -> int:
    """Let typer find and call the command; its own refusals become one sentence."""
    try:
        code = command(arguments).main(args=arguments, prog_name="blockmech", standalone_mode=False)
    except Exception as error:
        # Typer took click into itself under another name, so its errors are recognised by form.
        if type(error).__name__ == "Abort":
            raise KeyboardInterrupt from None
        if not hasattr(error, "format_message"):
            raise
        is_help = type(error).__name__ == "NoArgsIsHelpError"
        note(error.format_message() if is_help else _misuse(error))
        return WRONG
    if code == INTERRUPTED:
        raise KeyboardInterrupt
    return code if isinstance(code, int) else DONE


def _misuse(error: Any) -> str:
    """What typer refuses, with the name that is nearest in the words of the trade."""
    context: Any = getattr(error, "ctx", None)
    called = context.command_path if context else "blockmech"
    message = GUESSES.split(" ".join(error.format_message().split()))[0].rstrip(".")
    usage = context.get_usage().removeprefix("Usage: ") if context else called
    before, names = "", []
    if context and hasattr(error, "option_name"):
        before = "--"
        names = [o[2:] for x in context.command.params for o in x.opts if o.startswith("--")]
    elif message.startswith("No such command"):
        names = context.command.list_commands(context)
    word = message.rpartition(" ")[2].strip("'-")
    remedy = close_match(word, names).replace('"', f'"{before}', 1)
    valid = f"there are {listed((before + x for x in names), len(names))}" if names else ""
    sentences = filter(None, (message, remedy or valid, f"{usage}; see {called} --help"))
    return f"{called}: {'. '.join(sentences)}".replace("?.", "?")


def command(arguments: Sequence[str] | None = None) -> Any:
    """The whole application as one command that can be called.

    Of commands that are not among the words of a call only name and purpose are read.
    """
    complete = arguments is None or COMPLETING in os.environ
    app = typer.Typer(
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_shared)
    for function in COMMANDS:
        called = complete or function.__name__.rstrip("_") in (arguments or ())
        app.command()(flat(function) if called else _unread_command(function))
    return typer.main.get_command(app)


def _unread_command(function: Callable[..., Any]) -> Callable[[], None]:
    """A command without its options: reading those of all took a tenth of any call."""

    def unread() -> None:
        raise AssertionError(function.__name__)

    unread.__name__, unread.__doc__ = function.__name__, function.__doc__
    return unread


def _version(requested: bool) -> None:
    if requested:
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
