"""Ctrl-C at any moment: one sentence, exit code 130, and what is whole is kept."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from blockmech.cli import output, terminal
from blockmech.cli.output import NUMBERS
from blockmech.result.spreadsheet import csv_chunks
from tests.gallery import GRAPHS

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C to a console")
SIXBAR = str(GRAPHS / "watt_sixbar.json")
LONG = ["--until", "time=20", "--method", "rk4", "--step", "5e-5"]  # half a minute at least


def press(*_, **__):
    """Ctrl-C, as it reaches this process."""
    signal.raise_signal(signal.SIGINT)


@pytest.fixture(autouse=True)
def ctrl_c():
    """The command has Ctrl-C to itself, as in a process of its own; nothing is left pressed."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("module", ["blockmech.ground.sigint", "pydantic", "blockmech.builders"])
@pytest.mark.parametrize("called", ["module", "script"])
def test_ctrl_c_while_modules_are_loaded(called, module, tmp_path):
    """That takes most of the first half second."""
    script = tmp_path / "blockmech"  # what an installer writes
    script.write_text("import sys\nfrom blockmech.cli import main\nsys.exit(main())\n", "utf-8")
    command = ["-m", "blockmech"] if called == "module" else [str(script)]
    run = subprocess.Popen(
        [sys.executable, "-X", "importtime", *command, "run", SIXBAR],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    while not run.stderr.readline().rstrip().endswith(f" {module}"):
        assert run.poll() is None
    run.send_signal(signal.SIGINT)
    run.send_signal(signal.SIGINT)
    out, err = run.communicate(timeout=60)
    messages = [line for line in err.splitlines() if not line.startswith("import time:")]
    assert (run.returncode, out, messages) == (130, "", ["interrupted"])


def test_a_program_of_another_name_keeps_its_own_ctrl_c():
    code = (
        "import signal; a = signal.getsignal(2); import blockmech; assert a is signal.getsignal(2)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_while_pictures_are_drawn_the_numbers_are_there(call, tmp_path, monkeypatch):
    monkeypatch.setattr("blockmech.draw.run_pictures", press)
    outcome = call("run", SIXBAR, "--samples", "3", "--out", tmp_path / "out")
    assert (outcome.code, outcome.out) == (130, "")
    assert outcome.err == "interrupted: the numbers are written, the pictures are not\n"
    assert {p.name for p in (tmp_path / "out").iterdir()} == {*NUMBERS}
    assert json.loads((tmp_path / "out" / "result.json").read_text("utf-8"))["samples"] == 3


@pytest.mark.parametrize("times", [1, 2])
def test_while_numbers_are_written_they_are_completed(call, tmp_path, monkeypatch, times):
    def pressed(*arguments, **settings):
        for _ in range(times):
            press()
        yield from csv_chunks(*arguments, **settings)

    monkeypatch.setattr(output, "csv_chunks", pressed)
    outcome = call("run", SIXBAR, "--samples", "3", "--out", tmp_path / "out")
    assert (outcome.code, outcome.out, len(outcome.err.splitlines())) == (130, "", 1)
    assert {p.name for p in (tmp_path / "out").iterdir()} == {*NUMBERS}


def test_numbers_that_take_long_are_given_up(call, tmp_path, monkeypatch):
    def endless(*_, **__):
        while True:
            yield "1"
            press()

    monkeypatch.setattr(output, "csv_chunks", endless)
    monkeypatch.setattr(terminal, "INSISTS", None)
    monkeypatch.setattr(terminal, "SAVING", 0.05)
    outcome = call("run", SIXBAR, "--samples", "3", "--out", tmp_path / "out")
    assert (outcome.code, outcome.out, outcome.err) == (130, "", "interrupted\n")
    assert list(tmp_path.iterdir()) == []


def test_a_simulation_is_kept_as_far_as_it_came(call, tmp_path, monkeypatch):
    """The second Ctrl-C comes while its numbers are made and written."""

    @contextmanager
    def bar(*_):
        calls = iter(range(100))
        yield lambda *_: press() if next(calls) == 50 else None

    def again(*arguments, **settings):
        press()
        return csv_chunks(*arguments, **settings)

    monkeypatch.setattr(sys.modules["blockmech.cli.simulate"], "progress_bar", bar)
    monkeypatch.setattr(output, "csv_chunks", again)
    outcome = call("simulate", SIXBAR, *LONG, "--out", tmp_path / "out")
    assert (outcome.code, outcome.err) == (130, "interrupted\n")
    assert "ended: interrupted, after" in outcome.out
    assert {p.name for p in (tmp_path / "out").iterdir()} == {*NUMBERS}
    assert json.loads((tmp_path / "out" / "result.json").read_text("utf-8"))["samples"] == 201


def test_a_trade_is_kept_as_far_as_it_came(call, tmp_path, monkeypatch):
    monkeypatch.setattr("blockmech.analysis.trade.measure.Point", press)
    arguments = ["--want", "*.drive", "--want", "*.p", "--budget", "20s"]
    outcome = call("trade", SIXBAR, *arguments)
    assert (outcome.code, outcome.err) == (130, "interrupted: what was measured is kept\n")
    outcome = call("trade", SIXBAR, "--out", tmp_path / "out")
    assert outcome.code == 130
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"trade.csv", "trade.json"}


@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGKILL], ids=["term", "kill"])
def test_workers_end_with_the_command(tmp_path, sent):
    """Whoever reads the output sees its end: no worker holds the pipe any more."""
    arguments = ["sweep", str(GRAPHS / "ruiz_fourbar.json"), "--vary", "dyad.l_i=normal(6,0.05)"]
    arguments += ["--want", "max_abs(crank.drive)", "--sampling", "random", "--count", "3000000"]
    arguments += ["--out", str(tmp_path / "parts"), "--workers", "2"]
    run = subprocess.Popen(
        [sys.executable, "-m", "blockmech", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 120
    while not list((tmp_path).glob("parts/*.parquet")):
        assert run.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.1)
    run.send_signal(sent)
    run.communicate(timeout=60)
    assert run.returncode == (130 if sent is signal.SIGTERM else -sent)
