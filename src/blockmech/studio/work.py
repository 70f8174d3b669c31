"""Long work beside the page: in a thread, with its progress, a Stop button and an end."""

from __future__ import annotations

from collections.abc import Callable
from threading import Thread
from typing import Any

import panel as pn

from blockmech.ground.errors import BlockmechError
from blockmech.studio.looks import button

OnProgress = Callable[..., None]
HINTS = {"no-inertia": "Masses, above a drawing of links and joints, gives links those of bars."}


class Work:
    """One piece of work at a time; ``say`` hears how far it is, or why it failed."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self.say = say
        self.stop = button("Stop", self.cancel, disabled=True, visible=False, width=60)
        self.thread: Thread | None = None

    def cancel(self) -> None:
        """Ask the work to end: it does where it next tells of its progress."""
        self._stopped = True

    def begin(self, task: Callable[[OnProgress], Any], done: Callable[[Any], None]) -> None:
        """Run ``task(told)`` in a thread; ``done`` gets its answer, in the page's own thread.

        ``told(what, done, whole)`` is to be called now and then.
        """
        if not self.stop.disabled:
            return
        self._stopped, page = False, pn.state.curdoc
        self.stop.param.update(disabled=False, visible=True)
        later = page.add_next_tick_callback if page is not None else lambda act: act()

        def told(what: str, reached: float = 0, whole: float | None = None) -> None:
            if self._stopped:
                raise KeyboardInterrupt  # what Ctrl-C does: a simulation keeps what it has
            part = f" {reached:.4g} of {whole:.4g}" if whole else ""
            later(lambda: self.say(f"{what}{part}"))

        def end(answer: Any, message: str) -> None:
            self.stop.param.update(disabled=True, visible=False)
            self.say(message)
            if answer is not None:
                done(answer)

        def run() -> None:
            answer, message = None, "failed by an error of blockmech: see what the server printed"
            try:
                answer, message = task(told), ""
            except BlockmechError as error:
                message = " ".join((str(error), HINTS.get(error.problems[0].code, ""))).strip()
            except KeyboardInterrupt:
                message = "stopped"
            finally:  # other work may begin, whatever became of this
                later(lambda: end(answer, message))

        self.thread = Thread(target=run, daemon=True)
        self.thread.start()
