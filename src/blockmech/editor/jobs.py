"""Long work beside the server: in a process of its own, which can be ended at any time.

A job is a question in plain data; its answer comes with all that was said on the way. One process
works for all sheets, one job after the other; *Stop* ends it, and the next job begins another.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any

from blockmech.typing import Arguments, Data


class Job:
    """A question that is being answered.

    ``states`` are what it says on the way: "running" with what it does, at the end "done" with
    the answer, "failed" with the reason, or "stopped".
    """

    def __init__(self, task: Arguments) -> None:
        self.task, self.over = task, False
        self.states = SimpleQueue[tuple[str, str, Data | None]]()

    def tell(self, state: str, message: str = "", answer: Data | None = None) -> None:
        """Say how far it is, unless it is over."""
        if not self.over:
            self.over = state != "running"
            self.states.put((state, message, answer))


class Jobs:
    """The jobs of a server one after the other, and the process that works for them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._busy = Lock()
        self._current: Job | None = None
        self._process: Any = None

    def begin(self, task: Arguments) -> Job:
        """Ask for work; the answer comes in its own time."""
        job = Job(task)
        Thread(target=self._work, args=(job,), daemon=True).start()
        return job

    def stop(self, job: Job) -> None:
        """End a job that is not over, and the process if it works on it."""
        if not job.over:
            job.tell("stopped", "stopped")
            if self._current is job:
                self.end()

    def end(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()

    def _work(self, job: Job) -> None:
        with self._busy:
            self._current, process = job, self._worker()
            if job.over:  # a stop from now on ends the process
                return
            try:
                job.tell("running", job.task["title"])
                pickle.dump(job.task, process.stdin)
                process.stdin.flush()
                state = "running"
                while state == "running":  # also of a job that is over: until the process ends
                    state, message, answer = pickle.load(process.stdout)
                    job.tell(state, message, answer)
            except (EOFError, OSError, pickle.UnpicklingError):
                job.tell("failed", "the process that worked on it has ended")
                for stream in (process.stdin, process.stdout):
                    with suppress(OSError):
                        stream.close()

    def _worker(self) -> Any:
        """A process that waits for work."""
        if self._process is None or self._process.poll() is not None:
            command = [sys.executable, "-m", "blockmech.editor.worker", str(self.folder)]
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        return self._process
