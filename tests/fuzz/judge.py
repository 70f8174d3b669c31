"""What may not happen to a document, whatever stands in it.

It is read, compiled, run, verified and simulated, and asked a few of all public calls. A
`BlockmechError` is an answer; any other exception, a hang, a number that is none in a sample with
an answer, and an answer beside a failing `verify` are findings.
"""

from __future__ import annotations

import json
import random
import signal
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

import blockmech as bm
from blockmech.builders import Graph, Linkage, Opened
from blockmech.ground.units import UnitWarning
from blockmech.mechanism import Mechanism
from blockmech.model.document import read
from blockmech.result.result import Result
from tests.calls import BUDGET, METHODS, MORE, Subject, faults, silent
from tests.codes import FILE_CODES, LINKAGE_CODES
from tests.fuzz.mutants import Mutant, mutant

LONGEST = 30.0  # [s] of the thread's processor time for one document
SAMPLES = 7
MOVES = "time=0.3"
EACH = 2  # of all calls, on each document
OUTPUTS = 4  # about which those calls are asked that go through all, a second each at worst
SLOW = {"trade", "enclose", "tolerance", "trade of a motion", "replace", "mode shapes"}
ASKED = [call for call in (*METHODS, *MORE, "write c", "write svg") if call not in SLOW]

T = TypeVar("T")


class Hang(BaseException):
    """No answer within the time: no `except Exception` may swallow it."""


@dataclass
class Findings:
    """What became of some documents: how far each came, and what may not happen."""

    reached: Counter[str] = field(default_factory=Counter)
    problems: list[tuple[Mutant, str, str]] = field(default_factory=list)  # mutant, kind, detail

    def judge(self, seed: int, number: int) -> None:
        """Make a mutant and see what becomes of it."""
        document = mutant(seed, number)
        try:
            with soon(LONGEST), warnings.catch_warnings(record=True) as warned:
                warnings.simplefilter("always")
                for stage, kind, detail in judged(document.text):
                    self.reached[stage] += 1
                    if kind:
                        self.problems.append((document, kind, detail))
                for message in sorted({f"{w.filename}:{w.lineno}: {w.message}" for w in warned}):
                    self.problems.append((document, "warning", message))
        except Hang:
            self.problems.append((document, "hang", last_lines()))
        except Exception:
            self.problems.append((document, "traceback", traceback.format_exc()))


def judged(text: str) -> Iterator[tuple[str, str, str]]:
    """(Stage, kind of finding, detail) of each stage that a document comes through."""
    document = _answer(lambda: read(text, "mutant.json", _kind), FILE_CODES | set(LINKAGE_CODES))
    if document is None:
        yield "refused", "", ""
        return
    repr(document)
    written = document.to_json()
    if type(document).from_json(written).to_json() != written:
        yield "read", "written otherwise when it is read again", written
    mechanism = _answer(document.compile)
    if mechanism is None:
        yield "not compiled", "" if document.check() else "check finds nothing wrong", ""
        return
    yield "compiled", "", ""
    result = _answer(lambda: mechanism.run(samples=SAMPLES, on_gap="mark"))
    result = result or _answer(lambda: mechanism.run(_zeros(mechanism), on_gap="mark"))
    if result is not None:
        yield "run", *_numbers(result)
        with warnings.catch_warnings():  # of whole tens of radians, which nobody wrote here
            warnings.simplefilter("ignore", UnitWarning)
            checks = _answer(lambda: mechanism.verify(**_places(result)))
        if checks is not None and checks.samples and not checks.ok and not _doubted(result):
            bad = ", ".join(f"{r.name} {r.value:.2g}" for r in checks.rows if not r.ok)
            yield "verified", "ok beside a failing verify", bad
        else:
            yield "verified", "", ""
    moved = _answer(lambda: mechanism.simulate(MOVES, budget=BUDGET))
    if moved is not None:
        yield f"moved: {moved.motion.status}", *_numbers(moved)
    subject, chance = Subject(document, mechanism), random.Random(text)
    calls = chance.sample(ASKED, EACH)
    subject.outputs = chance.sample(subject.outputs, min(OUTPUTS, len(subject.outputs)))
    for call in calls:
        for fault in faults(subject, call):
            yield call, fault.kind, f"{call}: {fault.detail}"


def _kind(raw: dict[str, Any]) -> type[Opened]:
    return Linkage if "joints" in raw else Graph


def _answer(ask: Callable[[], T], accepted: Collection[str] = ()) -> T | None:
    """What is asked for; None where blockmech refuses in its own words, and by known codes."""
    try:
        return ask()
    except bm.BlockmechError as error:
        if accepted and not {p.code for p in error.problems} <= set(accepted):
            raise RuntimeError("a code that a file should not cause") from error
        if not all(p.code and p.found and str(p).isprintable() for p in error.problems):
            raise RuntimeError("an error without words, or with signs that are none") from error
        return None


def _zeros(mechanism: Mechanism) -> dict[str, list[float]]:
    return {driver: [0.1, 0.7, 2.0] for driver in mechanism.drivers}


def _places(result: Result) -> dict[str, Any]:
    """The same samples, once more."""
    if result.samples.times is not None:
        return {"times": result.samples.times}
    if not result.mechanism.drivers:
        return {"samples": result.n}
    at = {d: result.samples.coordinate(i) for i, d in enumerate(result.mechanism.drivers)}
    return {"at": at}


def _doubted(result: Result) -> bool:
    """Whether the run itself says that digits are lost."""
    return bool(result._lost_digits)


def _numbers(result: Result) -> tuple[str, str]:
    """A finding if a sample with an answer holds a number that is none, or data are not JSON."""
    json.dumps(result.to_dict(), allow_nan=False)
    repr(result)
    for name in silent(result):
        return "silent NaN", name
    return "", ""


@contextmanager
def soon(longest: float) -> Iterator[None]:
    """Raise `Hang` after so much processor time [s] of this thread, and again until it ends.

    Threads of linear algebra that wait for each other on a busy machine do not count.
    """
    start = time.thread_time()

    def look(signum: int, frame: Any) -> None:
        if time.thread_time() - start > longest:
            _STOPPED[:] = traceback.format_stack(frame)[-6:]
            raise Hang

    before = signal.signal(signal.SIGALRM, look)
    signal.setitimer(signal.ITIMER_REAL, min(longest, 1.0), 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


_STOPPED: list[str] = []


def last_lines() -> str:
    return "".join(_STOPPED)
