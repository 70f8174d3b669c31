"""The process that answers long questions for the server: started by `blockmech.editor.jobs`.

Tasks come on its standard input, and what it says goes to its standard output, both pickled.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import traceback
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from blockmech.builders import read_text
from blockmech.editor.analyses import analysis, synthesis
from blockmech.editor.curves import simulation
from blockmech.editor.exports import exported
from blockmech.editor.revision import Question, Revision
from blockmech.editor.sheets import picture_of
from blockmech.ground.errors import BlockmechError, Problem
from blockmech.model.subgraph import Resolver, resolving
from blockmech.typing import Arguments, Data


def work(folder: str) -> None:
    """What the process does: answer one task after the other, until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is the server's
    if hasattr(os, "nice"):
        os.nice(5)  # the page comes first
    tasks, out = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr  # whatever is printed is no answer
    answerer = Answerer(Path(folder))

    def tell(state: str, message: str = "", answer: Data | None = None) -> None:
        pickle.dump((state, message, answer), out)
        out.flush()

    def report(activity: str, reached: float = 0, total: float | None = None) -> None:
        tell("running", activity + (f" {reached:.4g} of {total:.4g}" if total else ""))

    while True:
        try:
            task = pickle.load(tasks)
        except EOFError:
            return
        try:
            tell("done", "", answerer.answer(task, report))
        except BlockmechError as error:
            tell("failed", message_of(error))
        except Exception as error:  # whatever it is, the next task is answered
            traceback.print_exc()
            tell("failed", f"an error of blockmech, see the server's window: {error!r}")


def message_of(error: BlockmechError) -> str:
    """An error as a sentence, with what mends it on the page."""
    problems: tuple[Problem, ...] = error.problems
    hint = "Masses gives links the mass of bars." if problems[0].code == "no-inertia" else ""
    return " ".join(filter(None, (str(error), hint)))


class Answerer:
    """Answers tasks, and remembers the last motion under loads of each sheet."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.simulated = dict[str, tuple[str, Any]]()  # sheet -> text of its document, motion

    def answer(self, task: Arguments, report: Callable[..., None]) -> Data:
        """The answer of a task. Raises `BlockmechError` for what has none."""
        if task["what"] == "picture":
            return {"name": task["kind"], "data": picture_of(task["kind"])}
        with resolving(Resolver(str(self.folder))):
            document = read_text(task["text"], task["file"])
            now = Revision(0, document.to_data(), document)
            text, motion = self.simulated.get(task["sheet"], ("", None))
            previous = motion if task.get("simulated") and text == task["text"] else None
            question, ask = task["what"], Question(now, task, report, previous)
            if question == "simulate":
                motion, reply = simulation(replace(ask, computed=None))
                self.simulated = {task["sheet"]: (task["text"], motion)}
                return reply
            if question == "export":
                name, data = exported(task["kind"], ask)
                return {"name": name, "data": data}
            return synthesis(ask) if question == "synthesis" else analysis(ask, question)


if __name__ == "__main__":
    work(sys.argv[1])
