"""``blockmech test``: one line an entry, a table for what fails, exit codes for machines."""

from __future__ import annotations

import json

from tests.testing.conftest import MET, MISSED


def test_what_is_met_is_one_line_an_entry(call, file):
    path = file("arm.json", MET, MET)
    outcome = call("test", path)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.splitlines() == [
        f"ok     {path} expect[0]: 1 number (by hand)",
        f"ok     {path} expect[1]: 1 number (by hand)",
        "2 ok, 0 failed",
    ]


def test_what_fails_is_a_table_and_exit_code_1(call, file):
    path = file("arm.json", MET, MISSED)
    outcome = call("test", path)
    assert (outcome.code, outcome.err) == (1, "")
    lines = outcome.out.splitlines()
    assert lines[1] == f"FAILS  {path} expect[1]: 1 of 4 numbers (a slip)"
    heads = ("output", "expected", "got", "tolerance", "margin")
    assert all(word in lines[2] for word in heads)
    row = ["crank.q", "[rad]", "1:", "crank", "=", "1", "1.5", "1", "0.5", "0.001", "-"]
    assert lines[3].split() == row
    assert lines[4:] == ["1 ok, 1 failed"]


def test_a_long_table_is_cut_with_the_worst_first(call, file):
    angles = [0.01 * k for k in range(40)]
    want = {"crank.q": [0.0] * 40}
    entry = {"source": "a slip", "at": {"crank": angles}, "want": want, "atol": 1e-3}
    lines = call("test", file("arm.json", entry)).out.splitlines()
    assert lines[0].endswith("expect[0]: 39 of 40 numbers (a slip)")
    assert "crank = 0.39" in lines[2]
    assert lines[-2].strip() == "... and 27 more"


def test_a_free_motion_is_not_passed_silently(call, file):
    motion = {"source": "by hand", "simulate": {"times": [0.0]}, "want": {"crank.q": [0.0]}}
    outcome = call("test", file("arm.json", {**motion, "atol": 1.0}))
    assert outcome.code == 2
    assert "no start for: crank" in outcome.err


def test_a_folder_is_taken_with_its_folders_but_not_those_that_are_wrong_on_purpose(
    call, file, tmp_path
):
    taken = [file(f"graphs/{name}", MET) for name in ("a.json", "more/b.json")]
    for name in ("broken/c.json", "more/legacy/d.json"):
        file(f"graphs/{name}", MISSED)
    (tmp_path / "graphs" / "notes.txt").write_text("no graph", encoding="utf-8")
    outcome = call("test", tmp_path / "graphs")
    assert outcome.code == 0
    assert outcome.out.splitlines()[:-1] == [
        f"ok     {path} expect[0]: 1 number (by hand)" for path in taken
    ]


def test_a_file_named_twice_runs_once(call, file, tmp_path):
    path = file("graphs/a.json", MET)
    assert call("test", path, tmp_path / "graphs", path).out.splitlines()[-1] == "1 ok, 0 failed"


def test_wrong_files_are_exit_code_2_and_stop_no_other(call, file, tmp_path):
    good = file("good.json", MET)
    unknown = file("unknown.json", MET, {**MET, "want": {"crank.qq": [0.0]}})
    spoiled = tmp_path / "spoiled.json"
    spoiled.write_text("{", encoding="utf-8")
    empty = tmp_path / "empty"
    empty.mkdir()
    outcome = call("test", spoiled, unknown, tmp_path / "missing.json", empty, good)
    assert outcome.code == 2
    assert outcome.out.splitlines() == [
        f"wrong  {spoiled}",
        f"ok     {unknown} expect[0]: 1 number (by hand)",
        f"wrong  {unknown}",
        f"wrong  {tmp_path / 'missing.json'}",
        f"wrong  {empty}",
        f"ok     {good} expect[0]: 1 number (by hand)",
        "2 ok, 0 failed, 4 files wrong",
    ]
    heads = [
        f"[truncated] {spoiled}: ",
        f"[unknown-output] {unknown}: ",
        f"[no-file] {tmp_path / 'missing.json'}: ",
        f"[no-file] {empty}: ",
    ]
    lines = outcome.err.splitlines()
    assert [line[: len(head)] for line, head in zip(lines, heads, strict=True)] == heads


def test_everything_is_there_as_data(call, file):
    path = file("arm.json", MET, MISSED)
    outcome = call("test", path, "--json")
    assert (outcome.code, outcome.err) == (1, "")
    data = json.loads(outcome.out)
    assert data["ok"] is False
    (only,) = data["files"]
    assert (only["file"], only["graph"], only["ok"]) == (str(path), "arm", False)
    assert [(e["entry"], e["source"], e["ok"]) for e in only["entries"]] == [
        (0, "by hand", True),
        (1, "a slip", False),
    ]
    assert [o["ok"] for o in only["entries"][1]["outcomes"]] == [True, False, True, True]
