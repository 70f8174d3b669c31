"""A few spoilt documents on every run of the suite; by hand as many as wanted.

``python -m tests.fuzz --documents 100000 --seed 1``
"""

from __future__ import annotations

import json

import pytest

from tests.fuzz.judge import Findings
from tests.fuzz.mutants import bases, mutant

SEED, BATCHES, DOCUMENTS = 2026, 2, 25


@pytest.mark.parametrize("batch", range(BATCHES))
def test_no_document_breaks_anything(batch):
    findings = Findings()
    for number in range(batch * DOCUMENTS, (batch + 1) * DOCUMENTS):
        findings.judge(SEED, number)
    problems = [
        f"--seed {SEED} --first {m.number}: {kind}: {why}" for m, kind, why in findings.problems
    ]
    assert problems == []
    assert findings.reached["verified"] > DOCUMENTS / 10  # most do not end at the parser


def test_a_mutant_can_be_made_again():
    assert mutant(7, 3) == mutant(7, 3)
    assert len({mutant(7, number).text for number in range(50)}) == 50


def loop(*_, **__):
    while True:
        pass


@pytest.mark.parametrize(
    ("verify", "kinds"), [(loop, {"hang"}), (lambda *_, **__: 1 / 0, {"traceback"}), (None, set())]
)
def test_the_judge_sees_what_may_not_happen(monkeypatch, verify, kinds):
    document = mutant(0, 0)._replace(text=json.dumps(dict(bases())["ruiz_fourbar.json"]))
    monkeypatch.setattr("tests.fuzz.judge.mutant", lambda seed, number: document)
    if verify is not None:
        monkeypatch.setattr("tests.fuzz.judge.LONGEST", 0.5)
        monkeypatch.setattr("blockmech.mechanism.Mechanism.verify", verify)
    findings = Findings()
    findings.judge(0, 0)
    assert {kind for _, kind, _ in findings.problems} == kinds
