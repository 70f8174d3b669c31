"""What a wrong file says: one clear message for each mistake, whatever the file.

``graphs/broken`` has a file for every code that the content of a file can cause, and
``tests/data/messages`` what blockmech says to it. The other codes are caused here.
"""

from __future__ import annotations

import ast
import json
import os
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import blockmech
from blockmech.assur.diagnosis import TEXTS
from blockmech.blocks.block import REGISTRY
from blockmech.builders import problems_in
from blockmech.ground.errors import LONGEST, MOST, BlockmechError, FormatError, GraphError, listed
from blockmech.model.reading import LARGEST
from tests.codes import FILE_CODES, LINKAGE_CODES
from tests.doors import graph_of as loads
from tests.soon import SOON, answered

ROOT = Path(__file__).resolve().parents[1]
BROKEN = sorted((ROOT / "graphs" / "broken").iterdir())
MESSAGES = Path(__file__).resolve().parent / "data" / "messages"
GOOD = (ROOT / "graphs" / "ruiz_fourbar.json").read_text(encoding="utf-8")

EXAMPLES = int(os.environ.get("BLOCKMECH_EXAMPLES", "40"))  # 10000 is the full run

FOLLOWS = {  # files in which a mistake has consequences, or that have more than one on purpose
    "bad_address",
    "group_conflicting",
    "group_locked",
    "group_turning_twice",
    "many_mistakes",
    "misspelt_key",
    "no_frame",
}


def said_about(path):
    """The messages, without what differs between machines and with installed packages."""
    text = "\n".join(map(str, problems_in(path))) + "\n"
    return text.replace(str(path), path.name).replace(listed(REGISTRY, 30), "(all types)")


def codes(path):
    return [problem.code for problem in problems_in(path)]


# Files of the repository.


@pytest.mark.parametrize("path", BROKEN, ids=lambda path: path.stem)
def test_a_broken_file_says_what_is_recorded(path):
    recorded = (MESSAGES / f"{path.stem}.txt").read_text(encoding="utf-8")
    assert said_about(path) == recorded


@pytest.mark.parametrize("path", BROKEN, ids=lambda path: path.stem)
def test_one_mistake_is_one_message(path):
    number = len(problems_in(path))
    assert number > 1 if path.stem in FOLLOWS else number == 1


@pytest.mark.parametrize("path", BROKEN, ids=lambda path: path.stem)
def test_every_message_names_the_file_and_stays_on_one_line(path):
    for problem in problems_in(path):
        assert problem.file == str(path)
        assert str(problem).isprintable()
        assert str(problem).startswith(f"[{problem.code}] {path}: ")


def test_a_name_of_a_file_moves_no_cursor_in_a_message_of_the_library():
    head = '"format": "blockmech/graph", "version": 1'
    graph = blockmech.Graph.from_json(f'{{{head}, "blocks": {{"a": {{"type": "\\u001b[31m"}}}}}}')
    with pytest.raises(GraphError) as caught:
        graph.compile()
    assert 'no block type "\\u001b[31m"' in str(caught.value)


@pytest.mark.parametrize("blocks", ["", '"blocks": null,', '"blocks": [],'])
def test_wires_of_a_file_without_blocks_are_no_further_mistakes(blocks):
    ends = '"wires": [{"from": "frame.A", "to": "crank.A"}]'
    with pytest.raises(FormatError) as caught:
        loads(f'{{"format": "blockmech/graph", "version": 1, {blocks} {ends}}}')
    assert [problem.where for problem in caught.value.problems] == ["blocks"]


def test_every_recorded_message_has_its_file():
    assert {p.stem for p in MESSAGES.iterdir()} == {p.stem for p in BROKEN}


def test_all_mistakes_of_a_file_are_said_at_once():
    result = codes(ROOT / "graphs" / "broken" / "many_mistakes.json")
    kinds = {"wrong-type", "wrong-value", "missing-key", "unknown-key"}
    assert kinds | {"unknown-marker", "unknown-joint", "unwired-joint"} == set(result)


# Files that a repository cannot hold.


def no_such_file(folder):
    return folder / "missing.json"


def a_name_that_is_no_file_name(folder):
    return folder / "null\0byte.json"


def a_folder(folder):
    return folder


def a_hundred_megabytes_of_garbage(folder):
    path = folder / "garbage.json"
    with path.open("wb") as stream:
        stream.truncate(100_000_000)
    return path


def a_file_of_someone_else(folder):
    path = folder / "secret.json"
    path.write_text(GOOD, encoding="utf-8")
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read everything")
    return path


def a_name_that_is_too_long(folder):
    if sys.platform == "win32":
        pytest.skip("Windows says that there is no such file")
    return folder / ("x" * 300 + ".json")


MADE = {
    no_such_file: "no-file",
    a_name_that_is_no_file_name: "no-file",
    a_folder: "not-a-file",
    a_hundred_megabytes_of_garbage: "too-large",
    a_file_of_someone_else: "no-permission",
    a_name_that_is_too_long: "unreadable",
}


@pytest.mark.parametrize("make", MADE, ids=lambda make: make.__name__)
def test_a_file_that_cannot_be_read_is_one_message(make, tmp_path):
    path = make(tmp_path)
    with answered(), pytest.raises(FormatError) as raised:
        blockmech.Graph.load(path)
    (problem,) = raised.value.problems
    assert problem.code == MADE[make]
    assert problem.file.startswith(str(tmp_path))


# No code without a file, none that nobody declared.


def test_every_code_that_a_file_can_cause_is_caused():
    caused = {code for path in BROKEN for code in codes(path)} | set(MADE.values())
    assert caused == set(FILE_CODES)


NOT_FROM_FILES = {
    "missing-package",  # an extra
    "bad-point",  # from_points
    "broken-plugin",  # an installed package
    "duplicate-block",  # Graph.add; in a file it is a duplicate key
    "frozen",  # a field set in Python
    "idle-driver",  # a remark
    "not-a-block",  # Graph.add
    "not-a-law",  # Graph.drive
    "not-inside",  # the studio's folder
    "not-json",  # data added in Python
    "not-wanted",  # read from a result
    "unknown-attribute",  # set in Python
    "user-function",  # a law that is a function of Python
    "wrong-function",  # likewise
    "unreachable",  # a remark
    "unused-marker",  # a remark
}


def test_every_code_in_the_source_is_declared():
    source = Path(blockmech.__file__).parent
    stems = ("values", "errors", "registry", "validation_errors")
    rooms = [source / "ground" / f"{stem}.py" for stem in stems]
    rooms += [
        p
        for room in ("model", "blocks", "functions", "loads", "friction")
        for p in (source / room).rglob("*.py")
    ]
    makers = {"Problem", "mistake", "PydanticCustomError", "unknown_name", "_error"}
    calls = [
        call
        for path in rooms
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call)
    ]
    firsts = [c.args[0] for c in calls if getattr(c.func, "id", "") in makers and c.args]
    firsts += [key.value for c in calls for key in c.keywords if key.arg == "code"]
    result = {first.value for first in firsts if isinstance(first, ast.Constant)} | set(TEXTS)
    assert result - set(FILE_CODES) - set(LINKAGE_CODES) == NOT_FROM_FILES


# Floods: files half as large as they may be in which everything is wrong, in half the time.

LONG = LARGEST // 2


def flooded(anchor, flood):
    """The four-bar with something put in after a place."""
    return GOOD.replace(anchor, anchor + flood, 1)


FLOODS = {
    "brackets": lambda: "[" * LONG,
    "digits": lambda: "7" * LONG,
    "a text without end": lambda: '"' + "x" * (LONG - 1),
    "bytes": lambda: bytes(range(256)) * (LONG // 256),
    "keys": lambda: flooded("{", "".join(f'"{n:06}":1,' for n in range(LONG // 12))),
    "a long key": lambda: GOOD.replace("inertia", "x" * (LONG - 5000), 1),
    "wires that are none": lambda: flooded('"wires": [', "3," * (LONG // 20)),
    "wires to nothing": lambda: flooded('"wires": [', "{}," * (LONG // 20)),
    "blocks that are none": lambda: flooded(
        '"blocks": {', "".join(f'"{n:06}":{{}},' for n in range(LONG // 13))
    ),
    "NaN": lambda: flooded('"gravity": [', "NaN," * (LONG // 5)),
    "keys given again": lambda: flooded('"blocks": {', '"crank":1,' * (LONG // 12)),
}


@pytest.mark.parametrize("name", FLOODS)
def test_a_flood_is_answered_soon_and_shortly(name, tmp_path):
    text = FLOODS[name]()
    path = tmp_path / "flood.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    assert path.stat().st_size <= LONG
    with answered(SOON / 2):
        problems = problems_in(path)
    assert 1 <= len(problems) <= MOST + 1
    assert max(len(str(problem)) for problem in problems) < 5 * LONGEST


# Made documents: whatever stands in a file, it is read or refused with a message. Good ones
# that are spoilt in places: `tests.fuzz`.

WORDS = st.sampled_from(
    (
        *("frame", "crank", "dyad", "type", "dyad.rrr", "driver.crank", "links", "i", "A", "at"),
        *("law", "polar", "from", "to", "crank.A", "frame.A", "a.b.c", ".", ""),
        *("\ud800", "\n", "x" * 200),
    )
)
NUMBERS = st.one_of(
    st.integers(-3, 3),
    st.integers(min_value=10**300, max_value=10**320),
    st.floats(allow_nan=True, allow_infinity=True),
)
SCALARS = st.one_of(st.none(), st.booleans(), NUMBERS, WORDS, st.text(max_size=5))
DATA = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(WORDS | st.text(), inner, max_size=4)
    ),
    max_leaves=12,
)


@st.composite
def spoilt_texts(draw):
    """The text of the four-bar with pieces cut out, put in or given twice."""
    text = GOOD
    for _ in range(draw(st.integers(1, 4))):
        a, b = sorted(draw(st.tuples(*[st.integers(0, len(text))] * 2)))
        b = min(b, a + draw(st.sampled_from([0, 1, 5, 50, 5000])))
        piece = draw(st.one_of(st.just(""), st.just(text[a:b] * 2), st.text(max_size=5), WORDS))
        text = text[:a] + piece + text[b:]
    return text


DOCUMENTS = st.one_of(
    DATA.map(json.dumps),
    spoilt_texts(),
    st.text(),
    st.binary(),
    spoilt_texts().map(lambda text: text.encode("utf-16", "surrogatepass")),
)


@pytest.mark.slow
@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck))
@given(document=DOCUMENTS)
def test_a_made_document_is_read_or_refused(document, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "made.json"
    raw = document if isinstance(document, bytes) else document.encode(errors="surrogatepass")
    path.write_bytes(raw)
    graph, refusal = None, None
    with answered():
        try:
            graph = blockmech.Graph.load(path)
        except BlockmechError as error:
            refusal = error
    if graph is None:
        assert {problem.code for problem in refusal.problems} <= set(FILE_CODES)
        assert str(refusal).replace("\n", "").isprintable()
        return
    text = graph.to_json()
    assert loads(text).to_json() == text
    assert graph.check() or graph.compile().drivers
