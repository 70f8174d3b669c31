"""The command line takes what people type: units, gallery names, folders, words of the trade."""

import csv
import json
import math
import re
from pathlib import Path

import pytest

import blockmech as bm
from blockmech.blocks.block import REGISTRY
from blockmech.cli.numbers import row
from blockmech.ground.errors import RequestError
from blockmech.ground.texts import unit_of
from blockmech.ground.units import SUGGESTED, NoQuantity, quantity
from tests.gallery import GRAPHS

QUANTITIES = json.loads((Path(__file__).parents[1] / "data" / "quantities.json").read_text("utf-8"))


@pytest.mark.parametrize(("text", "unit", "value"), QUANTITIES["read"])
def test_numbers_with_units(text, unit, value):
    assert quantity(text, unit) == value


@pytest.mark.parametrize(("text", "unit", "message"), QUANTITIES["refused"])
def test_what_is_no_quantity_of_a_unit(text, unit, message):
    with pytest.raises(NoQuantity, match=re.escape(message)):
        quantity(text, unit)


def test_every_unit_that_the_package_names_is_read():
    """Those that fields declare, outputs have and messages suggest."""
    mechanisms = [
        bm.Graph.load(GRAPHS / f"{name}.json").compile() for name in ("ruiz_fourbar", "pump")
    ]
    fields = {unit_of(f) for name in REGISTRY for f in REGISTRY[name].model_fields.values()}
    outputs = {mech.outputs[name].unit for mech in mechanisms for name in mech.outputs}
    suggested = {u for units in SUGGESTED.values() for u in units.split(", ")}
    for unit in (fields | outputs | suggested | set(SUGGESTED)) - {""}:
        assert quantity(f"1 {unit}") > 0
    for si, units in SUGGESTED.items():
        assert quantity(f"1 {si}", si) == 1.0
        assert all(quantity(f"1 {unit}", si) > 0 for unit in units.split(", "))


@pytest.mark.parametrize(
    ("text", "first", "last", "count"),
    [
        ("0..360deg", 0.0, math.tau, 361),
        ("0..1turn", 0.0, math.tau, 361),
        ("-10..10°:5", -math.pi / 18, math.pi / 18, 5),
        ("90:180deg:4", math.pi / 2, math.pi, 4),
        ("1rad:90deg:2", 1.0, math.pi / 2, 2),
        ("0.5..1.5", 0.5, 1.5, 361),
    ],
)
def test_ranges(text, first, last, count):
    result = row("--at", text, "rad")
    assert (len(result), result[0], result[-1]) == (
        count,
        pytest.approx(first),
        pytest.approx(last),
    )


def test_a_range_of_times_and_what_is_no_range():
    assert row("--times", "0:20ms:3", "s") == [0.0, 0.01, 0.02]
    with pytest.raises(RequestError, match=r"a range is start:stop:count, or start\.\.stop"):
        row("--at", "0:1", "rad")


@pytest.mark.parametrize("text", ["0:360:37", "90", "0..180", "10,20,30"])
def test_whole_tens_without_a_unit_are_noted(call, ruiz, text):
    outcome = call("run", ruiz, "--at", text, "--want", "crank.drive")
    assert outcome.code == 0
    assert "these are radians" in outcome.err
    assert "deg" in outcome.err


def test_the_note_says_how_degrees_are_written(call, ruiz):
    err = call("run", ruiz, "--at", "0:360:37", "--want", "crank.drive").err
    assert '57.3 turns; degrees are written "360deg"' in err


@pytest.mark.parametrize("text", ["0", "0:6.28:4", "60deg", "0:360deg:37", "0,1,2", "15"])
def test_other_numbers_are_not_noted(call, ruiz, text):
    assert call("run", ruiz, "--at", text, "--want", "crank.drive").err == ""


def test_lengths_are_not_taken_for_degrees(call, slide):
    assert call("run", slide, "--at", "10,20", "--want", "table.q").err == ""


def test_gallery_names_need_no_path(call, tmp_path):
    assert "watt_sixbar" in call("check", "watt_sixbar").out
    assert call("check", "joints/ruiz_fourbar").code == 0
    outcome = call("check", "wat_sixbar")
    assert (outcome.code, outcome.out) == (2, "")
    assert 'did you mean "watt_sixbar"?' in outcome.err
    assert "no such file" in call("check", "nothing_like_it").err
    assert "gallery: no graph" in call("new", "nothing_like_it").err


def test_an_option_without_its_value_is_refused_in_a_sentence(call, ruiz):
    outcome = call("run", ruiz, "--want")
    assert (outcome.code, outcome.out) == (2, "")
    assert "Option '--want' requires an argument." in outcome.err
    assert "fault of blockmech" not in outcome.err


def test_a_file_comes_before_the_gallery(call, ruiz, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "watt_sixbar").write_bytes(ruiz.read_bytes())
    assert "ruiz" in call("check", "watt_sixbar").out


def test_until_and_sweep_take_units(call, ruiz):
    start = ("--start", "60°,300rpm", "--want", "crank.q")
    outcome = call("simulate", ruiz, *start, "--until", "time=1ms", "--times", "0:1ms:2", "--json")
    assert outcome.code == 0
    arguments = ("--vary", "weightlike.force.y=-1kN:-2kN:2", "--want", "max_abs(crank.drive)")
    assert "-2000" in call("sweep", ruiz, *arguments).out


def test_words_of_the_trade_find_the_name(call, ruiz):
    assert 'did you mean "crank.drive"?' in call("run", ruiz, "--want", "crank.torque").err
    err = call("run", "joints/ruiz_fourbar", "--want", "crank.torque").err
    assert 'did you mean "driver.motor.drive"?' in err


def test_csv_goes_into_a_folder_and_no_other_format_is_called_csv(call, ruiz, tmp_path):
    arguments = ("run", ruiz, "--samples", "3", "--want", "crank.drive", "--csv")
    assert call(*arguments, tmp_path).code == 0
    with open(tmp_path / "results.csv", encoding="utf-8") as stream:
        assert len(list(csv.reader(stream))) == 4
    outcome = call(*arguments, tmp_path / "a.xlsx")
    assert outcome.code == 2
    assert "CSV is not written to .xlsx" in outcome.err
    assert not (tmp_path / "a.xlsx").exists()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "powershell"])
def test_there_is_completion_for_each_shell(call, shell, capsys, monkeypatch):
    monkeypatch.setattr("shellingham.detect_shell", lambda: (shell, f"/bin/{shell}"))
    with pytest.raises(SystemExit) as caught:
        call("--show-completion")
    assert caught.value.code == 0
    assert "_BLOCKMECH_COMPLETE" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [
        ("sensitivity", "--want", "crank.drive", "--samples", "3", "--to", "dyad.l_i"),
        ("solutions", "--at", "1"),
    ],
    ids=["sensitivity", "solutions"],
)
def test_csv_of_other_commands_goes_where_that_of_run_goes(call, ruiz, tmp_path, arguments):
    command = (arguments[0], ruiz, *arguments[1:], "--csv")
    outcome = call(*command, tmp_path / "a.xlsx")
    assert (outcome.code, outcome.out) == (2, "")
    assert "CSV is not written to .xlsx" in outcome.err
    assert call(*command, tmp_path).code == 0
    written = (tmp_path / "results.csv").read_text("utf-8-sig")
    printed = call(*command, "-")
    assert printed.code == 0
    assert printed.out.replace("\r\n", "\n") == written.replace("\r\n", "\n")
    assert not (tmp_path / "-").exists()


def test_a_trade_is_printed_as_csv(call, ruiz, tmp_path):
    command = (
        "trade",
        ruiz,
        "--want",
        "crank.drive",
        "--samples",
        "7",
        "--budget",
        "500ms",
        "--csv",
    )
    outcome = call(*command, "-")
    assert outcome.code == 0
    first, *rows = csv.reader(outcome.out.splitlines())
    assert "seconds [s]" in first
    assert rows
    assert call(*command, tmp_path / "t.xlsx").code == 2
    assert call(*command, tmp_path).code == 0
    assert (tmp_path / "results.csv").exists()


def test_plain_numbers_take_units_too(call, ruiz):
    command = ("run", ruiz, "--samples", "3", "--want", "crank.drive", "--json")
    tolerance = ("--friction", "successive", "--tolerance")
    assert call(*command, *tolerance, "1e3").out == call(*command, *tolerance, "1kN").out
    outcome = call(*command, *tolerance, "3 mm")
    assert (outcome.code, outcome.out) == (2, "")
    assert (
        '--tolerance 3 mm: "3 mm" has another kind of unit. a number, in SI or with N, kN'
        in outcome.err
    )
    moved = ("simulate", ruiz, "--start", "60°,300rpm", "--until", "time=1ms", "--method", "rk4")
    assert call(*moved, "--step", "0.1ms").out == call(*moved, "--step", "1e-4").out
    assert call(*moved, "--step", "nan").code == 2


def test_drivers_may_share_an_option(capsys):
    from blockmech.cli import main

    shared = ["--at", "boom=1.2m,arm=1.4,curl=1.5m", "--want", "boom.q,curl.q", "--csv", "-"]
    main(["run", "excavator", *shared])
    assert capsys.readouterr().out.splitlines()[1].startswith("1.2,1.4,1.5")


def test_a_time_with_its_unit_is_the_end_of_a_motion():
    from blockmech.dynamics.request import Until

    assert Until.parse("500ms") == Until.parse("time=0.5") == Until("time", 0.5)
    with pytest.raises(RequestError, match="no stopping condition"):
        Until.parse("2")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run", "ruiz"], 'did you mean "ruiz_fourbar"'),
        (["export", "pump", "--to", "fmi"], 'did you mean "fmu"'),
        (["export", "watt_sixbar", "-o", "m.xml", "--set", "step=fast"], "write for example 0.1ms"),
        (["export", "watt_sixbar", "-o", "m.fmu", "--set", "step=-1"], "a number above 0"),
        (["export", "ruiz_fourbar", "-o", "m.dxf", "--set", "hole=no"], "write for example 20mm"),
    ],
)
def test_slips_have_one_message(arguments, expected, capsys, tmp_path, monkeypatch):
    from blockmech.cli import main

    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    message = capsys.readouterr().err
    assert expected in message
    assert "Traceback" not in message
    assert not list(tmp_path.iterdir())
