"""The border of the command line: exit codes, wrong files, pipes, consoles, Ctrl-C."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time

import pytest

import blockmech as bm

PYTHON = (sys.executable, "-m", "blockmech")
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="pipes and devices of POSIX")


def started(*arguments: str | os.PathLike[str], **options) -> subprocess.Popen[bytes]:
    """The real command in its own process."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "stdin": subprocess.DEVNULL}
    if os.name == "posix":  # a background job ignores Ctrl-C, and its children would as well
        pipes["preexec_fn"] = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    return subprocess.Popen([*PYTHON, *map(os.fspath, arguments)], **{**pipes, **options})


def test_the_real_command_gives_exit_codes_and_streams_and_loads_no_matplotlib(short, tmp_path):
    env = {**os.environ, "PYTHONPROFILEIMPORTTIME": "1"}  # modules are told on standard error
    running = [started("run", file, "--json", env=env) for file in (short, tmp_path / "none.json")]
    answers = [process.communicate(timeout=60) for process in running]
    assert [process.returncode for process in running] == [1, 2]
    result = bm.Graph.load(short).compile().run(on_gap="mark")
    assert json.loads(answers[0][0]) == result.to_dict()
    assert answers[1][0] == b""
    for _, err in answers:
        assert b"Traceback" not in err
        assert b"| blockmech" in err
        assert b"matplotlib" not in err


@pytest.mark.parametrize("command", ["run", "check", "verify", "draw"])
@pytest.mark.parametrize("content", [b"# not JSON\n", b"", bytes(range(256)) * 100, None])
def test_a_wrong_file_is_one_message_and_exit_code_2(call, tmp_path, command, content):
    file = tmp_path / "wrong.json"
    if content is None:
        file.mkdir()
    else:
        file.write_bytes(content)
    before = os.listdir(tmp_path)
    options = ("-o", tmp_path / "x.svg") if command == "draw" else ()
    outcome = call(command, file, *options)
    assert outcome.code == 2
    assert outcome.out == ""
    assert outcome.err.startswith("[")
    assert "wrong.json" in outcome.err
    assert outcome.err.count("\n") == 1
    assert "Traceback" not in outcome.err
    assert os.listdir(tmp_path) == before


def test_help_and_version_are_known_and_debug_shows_the_traceback(call, tmp_path):
    assert call("--version") == (0, f"blockmech {bm.__version__}\n", "")
    for arguments in ([], ["--help"], ["run", "--help"], ["blocks", "-h"]):
        outcome = call(*arguments)
        assert "Usage: blockmech" in outcome.out + outcome.err
        assert outcome.code == (
            2 if not arguments else 0
        )  # a call without a command is not complete
    for arguments in (("--debug", "run", tmp_path / "x"), ("run", tmp_path / "x", "--debug")):
        outcome = call(*arguments)
        assert (outcome.code, outcome.err[:9]) == (2, "Traceback")
        assert "FormatError" in outcome.err


def test_a_fault_of_blockmech_is_not_blamed_on_the_file(call, ruiz, monkeypatch):
    def fault(graph):
        raise ZeroDivisionError("fault")

    monkeypatch.setattr(bm.Graph, "compile", fault)
    outcome = call("run", ruiz)
    assert outcome.code == 3
    assert "ZeroDivisionError: fault" in outcome.err
    assert "report" in outcome.err


@POSIX
def test_a_reader_that_leaves_early_is_no_error(ruiz):
    process = started("run", ruiz, "--samples", "5000", "--csv", "-")
    assert process.stdout
    assert process.stdout.readline().startswith(b"crank.q [rad],")
    process.stdout.close()
    assert process.stderr
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait(timeout=60) == 0


@POSIX
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a device that is always full")
def test_a_full_disk_is_one_message(ruiz):
    with open("/dev/full", "wb") as full:
        process = started("run", ruiz, stdout=full)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert err.decode().startswith("[cannot-write] standard output: no space left")
    assert err.count(b"\n") == 1


@POSIX
def test_ctrl_c_ends_without_a_traceback(ruiz, tmp_path):
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    process = started("run", ruiz, "--samples", "5000", "--csv", pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        select.select([reader], [], [], 60)
        assert os.read(reader, 100).startswith(b"crank.q [rad],")
        time.sleep(0.1)  # the command now waits for room in the pipe
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        os.close(reader)
    assert process.returncode == 130
    assert out == b""
    assert err.decode().splitlines() == ["interrupted"]


def test_old_consoles_get_a_question_mark_for_letters_they_lack(tmp_path):
    g = bm.Graph("größe_𝛼", drive={"кривошип": bm.motion.ConstantRate(rate=1.0)})
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0)}))
    g.add("кривошип", bm.Crank(length=1.0))
    g.connect("frame.A", "кривошип.A")
    g.save(tmp_path / "x.json")
    env = {**os.environ, "PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    requests = ([], ["--want", "foo"], ["--at", "1", "--json"])
    running = [started("run", tmp_path / "x.json", *options, env=env) for options in requests]
    answers = [process.communicate(timeout=60) for process in running]
    assert [process.returncode for process in running] == [0, 2, 0]
    assert "größe_?".encode("cp1252") in answers[0][0]
    assert "????????".encode("cp1252") in answers[0][0]
    assert json.loads(answers[2][0]) == g.run(at=[1.0]).to_dict()
