"""What reaches a terminal: no sign of a file moves its cursor, and a closed stream is no crash."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys

import pytest

import blockmech as bm
from tests.gallery import GRAPHS, document

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="pipes and closed streams of POSIX")
EVIL = "\x1b[31m=1+1\r\x07\x9b\u202e"
COMMANDS = {
    "check": [],
    "run": ["--samples", "3"],
    "simulate": ["--until", "time=0.01"],
    "verify": [],
    "limits": [],
    "modes": ["--no-arcs"],
    "extremes": ["*.q"],
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
    more = COMMANDS[command]
    said = call(command, evil, *more)
    assert is_plain(said.out), repr(said)
    assert is_plain(said.err)
    assert said.code in (0, 1, 2)
    if command == "check":
        assert said.out.startswith("<Graph \\u001b[31m=1+1\\r\\u0007\\u009b\\u202e: 5 moving links")


@pytest.mark.parametrize("where", ["type", "key", "value"])
def test_messages_about_a_file_are_plain_text(call, tmp_path, where):
    data = document("ruiz_fourbar")
    block = data["blocks"]["crank"]
    block[{"type": "type", "key": EVIL, "value": "length"}[where]] = EVIL
    path = tmp_path / "evil.json"
    path.write_text(json.dumps(data), "utf-8")
    said = call("check", path)
    assert (said.code, said.out) == (2, "")
    assert "\\u001b[31m" in said.err
    assert is_plain(said.err)


def test_a_name_is_no_formula_of_a_spreadsheet_and_no_new_row(tmp_path):
    for sign in "=+-@":
        text = renamed(document("ruiz_fourbar"), "crank", f"{sign}SUM(A1)\r\n")
        result = bm.Graph.from_json(text).run(at=[-1.0, -2.0], want="*.q")
        head, *rows = csv.reader(io.StringIO(result.to_csv(), newline=""))
        assert head[0] == f"'{sign}SUM(A1)\\r\\n.q [rad]"
        assert [row[0] for row in rows] == ["-1.0", "-2.0"]  # numbers stay numbers


def test_a_trade_table_keeps_its_numbers():
    found = bm.Graph.from_json(json.dumps(document("ruiz_fourbar"))).compile().trade(budget=0.3)
    rows = list(csv.DictReader(io.StringIO(found.to_csv())))
    assert [float(row["error"]) for row in rows] == [p.error for p in found.points]
    assert [row["method"] for row in rows] == [p.method for p in found.points]


@POSIX
@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-", "2>&1 | head -c 1", "2>&1 | true"])
def test_a_closed_stream_is_no_crash(closed):
    file = str(GRAPHS / "ruiz_fourbar.json")
    calls = {f"run {file} --json": "0", "check none": "2"}
    shells, pipes = [], {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    for words in calls:
        line = f'"{sys.executable}" -m blockmech {words} {closed}; exit "${{PIPESTATUS[0]}}"'
        shells.append(subprocess.Popen(["bash", "-c", line], **pipes))
    for shell, code in zip(shells, calls.values(), strict=True):
        out, err = shell.communicate(timeout=60)
        assert str(shell.returncode) == code
        assert "Traceback" not in out + err
        assert "Exception" not in err


@POSIX
@pytest.mark.parametrize(
    "words", [["check"], ["draw", "-o", "x.svg", "--kind", "schedule"]], ids=" ".join
)
def test_a_pipe_is_read_once(tmp_path, words):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    command, *more = words
    run = subprocess.Popen(
        [sys.executable, "-m", "blockmech", command, str(pipe), *more],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    pipe.write_bytes((GRAPHS / "ruiz_fourbar.json").read_bytes())
    out, err = run.communicate(timeout=60)
    assert (run.returncode, err) == (0, b"")
    assert out


def test_an_unknown_window_system_does_not_matter(call, ruiz, tmp_path):
    code = "import sys; from blockmech.cli import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", code, "draw", ruiz, "-o", tmp_path / "x.svg"],
        env={**os.environ, "MPLBACKEND": "no-such-thing"},
        capture_output=True,
    )
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize("more", [[], ["--stroke"]])
def test_extremes_of_a_pattern_are_those_that_exist(call, ruiz, more):
    said = call("extremes", ruiz, "crank.*", "--json", *more)
    assert said.code == 0
    found = json.loads(said.out)["strokes" if more else "extremes"]
    assert len(found) > 5
    with pytest.raises(bm.RequestError, match="it is a pattern, which 27 outputs fit"):
        bm.Graph.load(ruiz).compile().extremes("crank.*")
