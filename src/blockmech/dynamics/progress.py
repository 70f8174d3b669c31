"""Progress that is told to a user, and how it may stop a run."""

from __future__ import annotations

from blockmech.dynamics.until import Progress


def once(progress: Progress) -> Progress:
    """The same, silent from when it raised: what is kept of a run is still looked at."""
    raised = False

    def told(what: str, done: float, whole: float | None) -> None:
        nonlocal raised
        if not raised:
            try:
                progress(what, done, whole)
            except KeyboardInterrupt:
                raised = True
                raise

    return told
