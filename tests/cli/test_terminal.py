"""What reaches a terminal: no sign of a file moves its cursor, and a closed stream is no crash."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
import threading

import pytest

import blockmech as bm
from tests.gallery import GRAPHS, document

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="pipes and closed streams of POSIX")
RUN = f"run {GRAPHS / 'ruiz_fourbar.json'} --json"
EVIL = "\x1b[31m=1+1\r\x07\x9b\u202e"
COMMANDS = {
    "check": [],
    "run": ["--samples", "3"],
    "simulate": ["--until", "time=0.01"],
    "verify": [],
    "limits": [],
    "modes": ["--no-arcs"],
    "extremes": ["*.q"],
    "equilibria": [],
    "linearize": [],
    "balance": ["--numbers", "second.l_i", "--at", "0:1:5"],
    "solutions": [],
    "outputs": [],
    "test": [],
    "draw": ["-o", "x.nono"],
    "trade": ["--budget", "0.01s"],
}


def renamed(data, block, name):
    """The text of a document in which a block has another name."""
    data["blocks"] = {name if b == block else b: x for b, x in data["blocks"].items()}
    drive = data["scene"]["drive"]
    data["scene"]["drive"] = {name if b == block else b: x for b, x in drive.items()}
    return json.dumps(data).replace(f'"{block}.', json.dumps(f"{name}.")[:-1])


@pytest.fixture
def evil(tmp_path):
    """A four-bar whose names would redraw a terminal."""
    data = document("watt_sixbar") | {"name": EVIL, "title": EVIL}
    path = tmp_path / "evil.json"
    path.write_text(renamed(data, "first", f"{EVIL}first"), "utf-8")
    return path


def is_plain(text):
    return all(line.isprintable() for line in text.split("\n"))


@pytest.mark.parametrize("command", COMMANDS)
def test_names_reach_a_terminal_as_plain_text(call, evil, command):
    options = COMMANDS[command]
    outcome = call(command, evil, *options)
    assert is_plain(outcome.out), repr(outcome)
    assert is_plain(outcome.err)
    assert outcome.code in (0, 1, 2)
    if command == "check":
        assert outcome.out.startswith(
            "<Graph \\u001b[31m=1+1\\r\\u0007\\u009b\\u202e: 5 moving links"
        )


@pytest.mark.parametrize("where", ["type", "key", "value"])
def test_messages_about_a_file_are_plain_text(call, tmp_path, where):
    data = document("ruiz_fourbar")
    block = data["blocks"]["crank"]
    block[{"type": "type", "key": EVIL, "value": "length"}[where]] = EVIL
    path = tmp_path / "evil.json"
    path.write_text(json.dumps(data), "utf-8")
    outcome = call("check", path)
    assert (outcome.code, outcome.out) == (2, "")
    assert "\\u001b[31m" in outcome.err
    assert is_plain(outcome.err)


def test_a_name_is_no_formula_of_a_spreadsheet_and_no_new_row(tmp_path):
    for sign in "=+-@":
        text = renamed(document("ruiz_fourbar"), "crank", f"{sign}SUM(A1)\r\n")
        result = bm.Graph.from_json(text).run(at=[-1.0, -2.0], want="*.q")
        head, *rows = csv.reader(io.StringIO(result.to_csv(), newline=""))
        assert head[0] == f"'{sign}SUM(A1)\\r\\n.q [rad]"
        assert [row[0] for row in rows] == ["-1.0", "-2.0"]  # numbers stay numbers


@POSIX
@pytest.mark.parametrize(
    ("arguments", "closed", "code"),
    [
        (RUN, ">&-", 0),
        (RUN, ">&- 2>&-", 0),
        (RUN, "2>&1 | head -c 1", 0),
        ("check none", "2>&-", 2),
        ("check none", "2>&1 | true", 2),
    ],
)
def test_a_closed_stream_is_no_crash(arguments, closed, code):
    line = f'"{sys.executable}" -m blockmech {arguments} {closed}; exit "${{PIPESTATUS[0]}}"'
    result = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60)
    assert result.returncode == code
    assert "Traceback" not in result.stdout + result.stderr
    assert "Exception" not in result.stderr


@POSIX
def test_a_pipe_is_read_once(call, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    text = (GRAPHS / "ruiz_fourbar.json").read_bytes()
    threading.Thread(target=(tmp_path / "pipe").write_bytes, args=(text,)).start()
    outcome = call("check", tmp_path / "pipe")
    assert (outcome.code, outcome.err) == (0, "")
    assert "mobility 1" in outcome.out


@POSIX
def test_a_pipe_is_drawn_and_an_unknown_window_system_does_not_matter(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    run = subprocess.Popen(
        [sys.executable, "-m", "blockmech", "draw", str(pipe), "-o", "x.svg", "--kind", "schedule"],
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "no-such-thing"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    pipe.write_bytes((GRAPHS / "ruiz_fourbar.json").read_bytes())
    out, err = run.communicate(timeout=60)
    assert (run.returncode, err) == (0, b"")
    assert out
