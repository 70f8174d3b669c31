"""Long work beside the server: in a process of its own, which can be ended at any time.

A job is a question in plain data; its answer comes with all that was said on the way. One process
works for all sheets, one job after the other; *Stop* ends it, and the next job begins another.
"""

from __future__ import annotations

import base64
import pickle
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from threading import Condition, Lock, Thread
from typing import Any

from blockmech.typing import Arguments, Data


class Job:
    """A question that is being answered.

    Attributes
    ----------
    state : "waiting", "running", "done", "failed" or "stopped"
    said : what it does now, or why it failed
    answer : once it is done
    """

    def __init__(self, task: Arguments) -> None:
        self.task = task
        self.state, self.said = "waiting", ""
        self.answer: Data | None = None
        self.changed = Condition()
        self.turns = 0  # how often it has changed

    @property
    def over(self) -> bool:
        """Whether nothing more will come."""
        return self.state in ("done", "failed", "stopped")

    def tell(self, state: str, message: str = "", answer: Data | None = None) -> None:
        """Change, unless it is over; who waits for it wakes up."""
        with self.changed:
            if not self.over:
                self.state, self.said, self.answer = state, message, answer
                self.turns += 1
                self.changed.notify_all()

    def data(self) -> Data:
        """As the page gets it; the content of a file in base 64."""
        answer = self.answer
        if answer and "data" in answer:
            answer = {**answer, "data": base64.b64encode(answer["data"]).decode()}
        return {"state": self.state, "said": self.said, "answer": answer}

    def wait(self, turns: int, seconds: float) -> bool:
        """Wait until it has changed more than ``seen`` times; whether it has."""
        with self.changed:
            return self.changed.wait_for(lambda: self.turns > turns, seconds)


class Jobs:
    """The jobs of a server one after the other, and the process that works for them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._busy = Lock()
        self._process: Any = None

    def begin(self, task: Arguments) -> Job:
        """Ask for work; the answer comes in its own time."""
        job = Job(task)
        Thread(target=self._work, args=(job,), daemon=True).start()
        return job

    def stop(self, job: Job) -> None:
        """End a job that is not over, and the process that works on it."""
        running = job.state == "running"
        job.tell("stopped", "stopped")
        if running:
            self.end()

    def end(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()

    def _work(self, job: Job) -> None:
        with self._busy:
            if job.over:
                return
            process = self._worker()
            try:
                job.tell("running", job.task["title"])
                pickle.dump(dict(job.task), process.stdin)
                process.stdin.flush()
                while not job.over:
                    job.tell(*pickle.load(process.stdout))
            except (EOFError, OSError, pickle.UnpicklingError):
                job.tell("failed", "the process that worked on it has ended")
            if self._process is not process or process.poll() is not None:
                for stream in (process.stdin, process.stdout):
                    with suppress(OSError):
                        stream.close()
            elif job.state == "stopped":
                self.end()  # it has not heard of it

    def _worker(self) -> Any:
        """A process that waits for work."""
        if self._process is None or self._process.poll() is not None:
            command = [sys.executable, "-m", "blockmech.editor.worker", str(self.folder)]
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        return self._process
