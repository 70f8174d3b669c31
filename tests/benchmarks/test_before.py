"""A regression of speed is believed only if all repetitions show it."""

from . import before


def test_a_regression_shows_in_every_repetition(monkeypatch, capsys):
    repetitions = [{"plan": 1.6, "run": 1.7}, {"plan": 1.2, "run": 1.6}, {"plan": 2.0, "run": 1.8}]
    monkeypatch.setattr("sys.argv", ["before", "HEAD"])
    monkeypatch.setattr(before, "ratios", lambda *_: repetitions.pop(0))
    assert before.main() == 1
    assert "in 3 repetitions: run\n" in capsys.readouterr().out


def test_one_fast_repetition_is_enough(monkeypatch):
    repetitions = [{"plan": 1.6}, {"plan": 1.4}]
    monkeypatch.setattr("sys.argv", ["before", "HEAD"])
    monkeypatch.setattr(before, "ratios", lambda *_: repetitions.pop(0))
    assert before.main() == 0
    assert not repetitions


def test_without_history_nothing_is_compared(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["before", "no-such-commit"])
    assert before.main() == 0
    assert "no commit" in capsys.readouterr().out
