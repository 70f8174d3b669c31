"""Command line: `main`, the border where every mistake becomes one clear message.

Exit codes: 0 done; 1 the file is fine but some wanted sample has no answer, or a
verification fails; 2 the file or the call is wrong. A fault of blockmech itself is
shown with its traceback and gives 3, Ctrl-C gives 130.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Sequence

from blockmech.errors import BlockmechError, SampleError

DONE, NO_ANSWER, WRONG, FAULT, INTERRUPTED = 0, 1, 2, 3, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and give its exit code.

    ``--debug`` may stand anywhere and shows the traceback of a user error.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in words
    _never_choke()
    try:
        return _run([w for w in words if w != "--debug"])
    except BlockmechError as error:
        if debug:
            traceback.print_exc()
        else:
            print(error, file=sys.stderr)
        return NO_ANSWER if isinstance(error, SampleError) else WRONG
    except MemoryError:
        print("not enough memory: ask for fewer samples or fewer outputs", file=sys.stderr)
        return WRONG
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except Exception:
        traceback.print_exc()
        print("This is a fault of blockmech: please report it with these lines.", file=sys.stderr)
        return FAULT


def _run(words: list[str]) -> int:
    """Let typer find and call the command; its own refusals become one sentence."""
    from blockmech.cli.app import command

    try:
        code = command().main(args=words, prog_name="blockmech", standalone_mode=False)
    except Exception as error:
        # Typer took click into itself under another name, so its errors are told by form.
        if type(error).__name__ == "Abort":
            raise KeyboardInterrupt from None
        if not hasattr(error, "format_message"):
            raise
        context = getattr(error, "ctx", None)
        called = context.command_path if context else "blockmech"
        message = " ".join(error.format_message().split())
        if type(error).__name__ == "NoArgsIsHelpError":
            print(error.format_message(), file=sys.stderr)
        else:
            print(f"{called}: {message} (see {called} --help)", file=sys.stderr)
        return WRONG
    if code == INTERRUPTED:
        raise KeyboardInterrupt
    return code if isinstance(code, int) else DONE


def _never_choke() -> None:
    """Consoles without Unicode get a question mark in place of a crash."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
