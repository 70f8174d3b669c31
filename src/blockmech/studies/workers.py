"""Parts of a study, handed out to processes: of this machine, or of a Dask cluster.

A part is asked for by value, so any process gives the same bytes for it, however often it is
asked; each keeps the program of the last study. Nothing here schedules: local processes are
`concurrent.futures`', those of a cluster `dask.distributed`'s. A worker that dies loses its
part only, which another one does.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from multiprocessing import get_context, parent_process
from typing import Any

from blockmech.ground.errors import needed, refused
from blockmech.ground.progress import PATIENCE
from blockmech.ground.values import is_count
from blockmech.studies.rows import Parts, Rows, Span
from blockmech.studies.runner import Runner
from blockmech.studies.sampling import Designs
from blockmech.typing import Record, Values

Answers = Generator[tuple[Span, Rows | None], None, None]


@dataclass(frozen=True)
class Work:
    """A study as what its parts need.

    Attributes
    ----------
    runner : what is asked of each design
    chosen : all designs
    parts : where answers are written, if they are not handed back
    """

    runner: Runner
    chosen: Designs
    parts: Parts | None = None

    @cached_property
    def pickled(self) -> bytes:
        """What is the same for all parts. Raises `RequestError` for functions that stay here."""
        parts = self.parts and replace(self.parts, place=self.parts.place.absolute(), spans=())
        try:
            return pickle.dumps((self.runner, self.chosen.count, parts))
        except (AttributeError, TypeError, pickle.PicklingError) as error:
            message = f"another process cannot be sent the study: {error}"
            remedy = "define functions of Python at the top of a module, or leave workers out"
            raise refused("workers", message, remedy, code="not-picklable") from error

    def here(self, spans: Sequence[Span]) -> Answers:
        """Parts done by this process, each of some time; what is handed back comes by blocks."""
        planned = self.runner.prepared(self.chosen.count)
        for first, last in spans:
            part, start, rows = self.chosen.part(first, last), first, list[Rows]()
            since = time.monotonic()
            for block in self.runner.blocks(planned, part):
                rows.append(block)
                stop = start + sum(len(x.word) for x in rows)
                if self.parts and stop < last and time.monotonic() < since + PATIENCE:
                    continue
                vary = part.columns(start - first, stop - first)
                yield (start, stop), _deliver(self.parts, (start, stop), vary, rows)
                start, rows, since = stop, [], time.monotonic()

    def by_processes(self, spans: Sequence[Span], workers: int) -> Answers:
        """Parts done by so many processes of this machine; new ones follow those that die.

        Raises `RequestError` where they die before they have done anything.
        """
        waiting = deque(spans)
        while waiting:
            submitted: dict[Future[Any], Span] = {}
            answered_any = False
            pool = ProcessPoolExecutor(workers, get_context("spawn"), _serve)
            try:
                while waiting or submitted:
                    while waiting and len(submitted) <= workers:  # one waits for who is first done
                        part = self.chosen.part(*waiting[0])
                        submitted[pool.submit(answered, self.pickled, part, waiting[0])] = waiting[
                            0
                        ]
                        waiting.popleft()
                    for future in wait(submitted, return_when=FIRST_COMPLETED).done:
                        answer = future.result()
                        yield submitted.pop(future), answer
                        answered_any = True
            except BrokenProcessPool as error:
                if not answered_any:
                    message = "the processes ended before they had done anything"
                    remedy = 'in a script, ask below "if __name__ == ...", '
                    remedy += "and see what the processes wrote"
                    raise refused("workers", message, remedy, code="workers-died") from error
                waiting.extendleft(submitted.values())
            finally:
                pool.shutdown(cancel_futures=True)

    def by_cluster(self, spans: Sequence[Span], client: Any) -> Answers:
        """Parts done by the workers of a `distributed.Client`, which replaces those that die."""
        distributed = needed("distributed", "workers", "cluster")
        common = client.submit(bytes, self.pickled)  # made again should a worker die with it
        submitted = {
            client.submit(answered, common, self.chosen.part(*span), span, pure=False): span
            for span in spans
        }
        try:
            for future in distributed.as_completed(list(submitted)):
                yield submitted.pop(future), future.result()
        finally:
            client.cancel(list(submitted))


def answered(pickled: bytes, chosen: Designs, span: Span) -> Rows | None:
    """A part: handed back, or None where it is written into a folder."""
    runner, planned, parts = _at_hand(pickled)
    rows = list(runner.blocks(planned, chosen))
    return _deliver(parts, span, chosen.columns(0, chosen.count), rows)


def _deliver(parts: Parts | None, span: Span, vary: Record, rows: list[Rows]) -> Rows | None:
    """Designs to be handed back; None where they are written into a folder."""
    if parts is None:
        return Rows.joined(rows)
    parts.write(span, vary, Rows.joined(rows))
    return None


@lru_cache(1)
def _at_hand(pickled: bytes) -> tuple[Runner, Values, Parts | None]:
    """A study in this process, with its program."""
    runner, count, parts = pickle.loads(pickled)
    return runner, runner.prepared(count), parts


def hands(work: Work, workers: Any) -> Callable[[Sequence[Span]], Answers]:
    """Who does the parts. Raises `RequestError` for workers that are none."""
    if workers is None:
        return work.here
    if is_count(workers):
        return lambda spans: work.by_processes(spans, workers)
    if isinstance(workers, int | float) or not isinstance(
        workers, needed("distributed", "workers", "cluster").Client
    ):
        remedy = "give a whole number from 1 on, or a dask.distributed.Client"
        raise refused("workers", f"got {workers!r:.60}", remedy)
    return lambda spans: work.by_cluster(spans, workers)


def _serve() -> None:
    """Ctrl-C is for the process that asks: it ends its workers. One that dies takes them along."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent_process(),), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)  # nobody waits for an answer
