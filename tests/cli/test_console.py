"""Consoles without Unicode: what blockmech says by itself, old code pages can show.

Windows gives a program whose output goes through a pipe the code page of the country, and
`print` fails there for a letter that it lacks. Names are the user's own; see
`test_main.test_old_consoles_get_a_question_mark_for_letters_they_lack`.
"""

from __future__ import annotations

import io
import sys
import time

import pytest

from blockmech.cli import command, terminal
from tests.gallery import GRAPHS

PAGES = ("cp1252", "cp850")  # of windows and of consoles in Western countries
COMMANDS = sorted(command().commands)
JOINTS = "joints/watt_sixbar"

DONE = {
    "a table": ["run", "FILE", "--samples", "5"],
    "a table in degrees": ["run", "FILE", "--samples", "5", "--deg"],
    "what a request costs": ["run", "FILE", "--explain"],
    "what a mechanism is": ["check", "FILE"],
    "links and joints": ["decompose", JOINTS],
    "arcs": ["limits", "FILE"],
    "assembly modes": ["modes", "FILE"],
    "extremes": ["extremes", "FILE", "dyad.transmission_angle"],
    "equilibria": ["equilibria", "FILE"],
    "solutions of friction": ["solutions", "FILE", "--at", "1.0"],
    "modes of vibration": ["linearize", "FILE", "--at", "60deg"],
    "a balance": ["balance", "FILE", "--numbers", "dyad.links.j.mass", "--want", "crank.drive"],
    "a record": ["identify", "FILE", "RECORD", "--to", "dyad.links.i.mass"],
    "an inverse question": ["solve", "FILE", "--want", "dyad.j.angle=100deg"],
    "checks": ["verify", "FILE"],
    "a trade": ["trade", "FILE", "--budget", "1s"],
    "designs": ["sweep", "FILE", "--vary", "dyad.l_i=5.5:6:3", "--want", "max_abs(crank.drive)"],
    "derivatives": ["sensitivity", "FILE", "--want", "crank.drive", "--at", "60deg"],
    "a free motion": ["simulate", "watt_sixbar", "--until", "time=0.1"],
    "expected numbers": ["test", "watt_sixbar"],
    "the gallery": ["new"],
    "formats that are written": ["export", "list"],
    "a report": ["report", "FILE", "-o", "REPORT"],
    "a drawing": ["import", "M[J[R, P[0, 0], L[ground, a]], J[R, P[0, 1], L[a]]]"],
    "all blocks": ["blocks"],
    "all outputs": ["outputs", "FILE"],
    "the schema": ["schema"],
}
NO_ANSWER = {
    "a mechanism with a gap": ["run", "SHORT"],
}
WRONG = {
    "an unknown output": ["run", "FILE", "--want", "crank.drve"],
    "an unknown option": ["run", "FILE", "--drve"],
    "no file": ["run", "no.json"],
    "no name of a file to draw": ["draw", "FILE"],
    "no name of a page": ["page", "FILE"],
    "no sheet": ["studio", "no.json", "--no-browser"],
}
CALLS = DONE | NO_ANSWER | WRONG
CODES = dict.fromkeys(DONE, 0) | dict.fromkeys(NO_ANSWER, 1) | dict.fromkeys(WRONG, 2)


def test_every_command_is_called_here():
    assert {arguments[0] for arguments in CALLS.values()} == set(COMMANDS)


@pytest.fixture
def show(call, ruiz, short, tmp_path):
    """Call the command line, and encode what it says as an old console would."""

    record = tmp_path / "record.csv"
    record.write_text("crank.q,crank.drive\n0,-10000\n1,3800\n2,500\n", encoding="utf-8")

    def showing(*arguments):
        files = {"FILE": str(ruiz), "SHORT": str(short), "RECORD": str(record)}
        files["REPORT"] = str(tmp_path / "report.html")
        gallery = {name: str(GRAPHS / f"{name}.json") for name in ("watt_sixbar", JOINTS)}
        outcome = call(*((files | gallery).get(word, word) for word in arguments))
        for page in PAGES:
            (outcome.out + outcome.err).encode(page)
        return outcome

    return showing


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_for_every_console(show, name):
    outcome = show(name, "--help")
    assert (outcome.code, outcome.err) == (0, "")
    assert f"Usage: blockmech {name}" in outcome.out


@pytest.mark.parametrize("name", CALLS)
def test_answers_are_for_every_console(show, name):
    outcome = show(*CALLS[name])
    assert (outcome.code, bool(outcome.out)) == (CODES[name], name not in WRONG)


class Terminal(io.TextIOWrapper):
    """A terminal of an old code page that refuses what it cannot show."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("page", PAGES)
def test_a_progress_bar_is_drawn_on_an_old_console(monkeypatch, page):
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stderr", Terminal(raw, encoding=page, errors="strict"))
    monkeypatch.setattr(terminal, "PATIENCE", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    with terminal.progress_bar("simulating") as report:
        start = time.monotonic()
        while b"half way" not in raw.getvalue() and time.monotonic() - start < 60:
            report("half way", 1.0, 2.0)
            time.sleep(0.02)
    sys.stderr.flush()
    assert b"simulating: half way" in raw.getvalue()
