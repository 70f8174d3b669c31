"""A study in parts: by whom, in what order and after what accident, the bytes are the same."""

import itertools
import multiprocessing
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import blockmech as bm
from blockmech.studies.runner import Runner
from blockmech.studies.workers import Work
from tests.gallery import GRAPHS, mechanism
from tests.machines import wire

VARY = {"dyad.l_i": bm.dist.Normal(6.0, 0.5), "frame.D.x": bm.dist.Uniform(5.4, 5.6)}
REQUEST = {
    "want": ["max_abs(crank.drive)", "mean(dyad.C.reaction)", "poses(dyad.C.p)"],
    "samples": 6,
    "sampling": bm.dist.Sample(400, "random"),
}
PART = 20  # designs, so that a small study has some parts


@pytest.fixture(autouse=True)
def small_parts(monkeypatch):
    monkeypatch.setattr(Runner, "part", lambda self, n: PART)


@pytest.fixture(scope="module")
def fourbar():
    return mechanism("ruiz_fourbar")


@pytest.fixture(scope="module")
def whole(fourbar):
    return fourbar.study(VARY, **REQUEST)


def assert_same(result, expected):
    assert result.n == expected.n
    assert result.status == expected.status
    for label in result:
        assert result[label].tobytes() == expected[label].tobytes(), label
    assert [result.reason(k) for k in range(result.n)] == [
        expected.reason(k) for k in range(expected.n)
    ]


def files(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.parquet"))}


def test_parts_read_as_what_the_study_found(fourbar, whole, tmp_path):
    parted = fourbar.study(VARY, **REQUEST, out=tmp_path / "new" / "parts")
    assert_same(whole, parted)
    assert set(whole.status) == {"ok", "no-assembly"}
    assert len(files(tmp_path / "new" / "parts")) == REQUEST["sampling"].count // PART
    assert parted.grid("poses(dyad.C.p)").shape == (400, 6)
    import pandas

    table = pandas.read_parquet(tmp_path / "new" / "parts")
    assert list(table["dyad.l_i"]) == list(whole["dyad.l_i"])
    assert tuple(table["status"]) == whole.status


def test_parts_of_any_size_hold_the_same(fourbar, whole, monkeypatch, tmp_path):
    monkeypatch.setattr(Runner, "part", lambda self, n: 7)
    assert_same(whole, fourbar.study(VARY, **REQUEST, out=tmp_path))


def test_an_interrupted_study_goes_on_where_it_stopped(fourbar, whole, tmp_path, monkeypatch):
    def stop(label, count, of):
        if count == 3 * PART:
            raise KeyboardInterrupt

    first = fourbar.study(VARY, **REQUEST, out=tmp_path, progress=stop)
    assert first.interrupted
    assert first.n == 3 * PART
    times = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    counts = []
    again = fourbar.study(VARY, **REQUEST, out=tmp_path, progress=lambda *x: counts.append(x[1]))
    assert counts == list(range(4 * PART, 401, PART))
    assert times.items() <= {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}.items()
    assert_same(whole, again)
    monkeypatch.setattr(Work, "here", lambda work, spans: iter(spans) if not spans else 1 / 0)
    assert_same(whole, fourbar.study(VARY, **REQUEST, out=tmp_path))


def test_a_study_is_written_after_each_second(fourbar, whole, tmp_path, monkeypatch):
    """Time is counted in calls here: a part is closed by the third block behind its first."""
    monkeypatch.setattr(Runner, "part", lambda self, n: 400)
    monkeypatch.setattr(Runner, "size", lambda self, n: PART)
    clock = SimpleNamespace(monotonic=itertools.count(0.0, 0.4).__next__)
    monkeypatch.setattr("blockmech.studies.workers.time", clock)

    def stop(label, count, of):
        if count > 200:
            raise KeyboardInterrupt

    first = fourbar.study(VARY, **REQUEST, out=tmp_path, progress=stop)
    before = files(tmp_path)
    assert [int(name.split("-")[1]) for name in before] == [0, 60, 120, 180]
    assert first.n == 240
    assert_same(whole, fourbar.study(VARY, **REQUEST, out=tmp_path))
    assert before.items() < files(tmp_path).items()
    monkeypatch.setattr(Work, "here", lambda work, spans: iter(spans) if not spans else 1 / 0)
    assert_same(whole, fourbar.study(VARY, **REQUEST, out=tmp_path))


def test_a_finished_study_is_read_without_what_draws_or_tabulates(fourbar, tmp_path):
    """Latin points are those of SciPy, whose statistics take longer to load than all else."""
    from scipy.stats import qmc

    request = {**REQUEST, "sampling": bm.dist.Sample(40, "latin", 3), "out": tmp_path}
    study = fourbar.study(VARY, **request)
    points = qmc.LatinHypercube(2, seed=np.random.default_rng(3)).random(40)
    assert np.array_equal(study["frame.D.x"], VARY["frame.D.x"].quantile(points[:, 1]))
    lines = (
        "import sys, blockmech as bm",
        f"mech = bm.Graph.load({str(GRAPHS / 'ruiz_fourbar.json')!r}).compile()",
        "vary = {'dyad.l_i': bm.dist.Normal(6.0, 0.5), 'frame.D.x': bm.dist.Uniform(5.4, 5.6)}",
        f"mech.study(vary, want={REQUEST['want']}, samples=6, progress=print,",
        f"    sampling=bm.dist.Sample(40, 'latin', 3), out={str(tmp_path)!r})",
        "print([x for x in ('scipy.stats', 'pyarrow.dataset') if x in sys.modules])",
    )
    command = [sys.executable, "-c", "\n".join(lines)]
    assert subprocess.run(command, capture_output=True, text=True).stdout == "[]\n"


def test_another_question_in_the_folder_is_refused(fourbar, tmp_path):
    request = {"want": "max(crank.drive)", "samples": 6, "out": tmp_path}
    fourbar.study({"dyad.l_i": [6.0, 6.1]}, **request)
    before = files(tmp_path)
    heavier = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").replace({"dyad.links.i.mass": 7.0})
    for mech, values, options in (
        (fourbar, [6.0, 6.2], {}),
        (fourbar, [6.0, 6.1], {"friction": "none"}),
        (fourbar, [6.0, 6.1], {"samples": 7}),
        (heavier.compile(), [6.0, 6.1], {}),
    ):
        with pytest.raises(bm.RequestError, match="parts of another question"):
            mech.study({"dyad.l_i": values}, **request | options)
    assert files(tmp_path) == before


def test_a_draft_that_a_dead_worker_left_is_no_part(fourbar, whole, tmp_path):
    (tmp_path / ".blockmech-0123abcd").write_bytes(b"half a file")
    assert_same(whole, fourbar.study(VARY, **REQUEST, out=tmp_path))


def test_local_processes_give_the_same_though_one_is_killed(fourbar, whole, tmp_path):
    fourbar.study(VARY, **REQUEST, out=tmp_path / "here")
    killed = []

    def kill(label, count, of):
        if not killed:
            killed.append(multiprocessing.active_children()[0])
            killed[0].kill()

    study = fourbar.study(VARY, **REQUEST, out=tmp_path / "there", workers=2, progress=kill)
    assert killed[0].exitcode == -signal.SIGKILL
    assert_same(whole, study)
    assert files(tmp_path / "here") == files(tmp_path / "there")


@pytest.mark.filterwarnings("ignore")  # Dask's own, e.g. of a worker that is gone
def test_a_cluster_gives_the_same_though_a_worker_is_killed(fourbar, whole, tmp_path):
    distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
    fourbar.study(VARY, **REQUEST, out=tmp_path / "here")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    killed = []
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:

        def kill(label, count, of):
            if not killed:
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

        study = fourbar.study(
            VARY, **REQUEST, out=tmp_path / "there", workers=client, progress=kill
        )
        assert_same(whole, study)
        assert killed
        assert files(tmp_path / "here") == files(tmp_path / "there")
        assert_same(whole, fourbar.study(VARY, **REQUEST, workers=client))


@pytest.mark.parametrize("sampling", ["latin", "sobol", "random", "grid", "paired"])
def test_a_design_does_not_depend_on_the_part_that_makes_it(fourbar, sampling):
    from blockmech.studies.sampling import designs

    drawn = sampling not in ("grid", "paired")
    rows = {"dyad.l_i": np.linspace(5.0, 6.0, 16), "frame.D.x": np.linspace(5.0, 6.0, 16)}
    chosen = designs(VARY, bm.dist.Sample(256, sampling, 3)) if drawn else designs(rows, sampling)
    every = chosen.columns(0, chosen.count)
    for start, stop in ((0, 5), (5, 16), (7, 8)):
        part = chosen.part(start, stop)
        for made in (part.columns(0, stop - start), chosen.columns(start, stop)):
            for address, x in made.items():
                np.testing.assert_array_equal(x, every[address][start:stop])
        inner = part.columns(2, 3) if stop - start > 2 else part.columns(0, 1)
        assert {x.size for x in inner.values()} == {1}


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"workers": 0}, "got 0. give a whole number from 1 on"),
        ({"workers": 2.0}, "got 2.0. give a whole number from 1 on"),
        ({"workers": "tcp://nowhere:1"}, "or a dask.distributed.Client"),
    ],
)
def test_workers_that_are_none_are_refused(fourbar, more, words):
    with pytest.raises(bm.RequestError, match=words):
        fourbar.study(VARY, **REQUEST, **more)


@pytest.mark.parametrize(("module", "extra"), [("pyarrow", "study"), ("distributed", "cluster")])
def test_a_missing_package_names_its_extra(fourbar, monkeypatch, tmp_path, module, extra):
    monkeypatch.setitem(sys.modules, module, None)
    more = {"out": tmp_path} if module == "pyarrow" else {"workers": object()}
    with pytest.raises(bm.MissingEngineError, match=rf"blockmech\[{extra}\]"):
        fourbar.study(VARY, **REQUEST, **more)


def test_a_place_that_cannot_be_written_is_one_message(fourbar, tmp_path):
    (tmp_path / "file").write_text("here", encoding="utf-8")
    with pytest.raises(bm.RequestError, match="it is a file, not a directory"):
        fourbar.study(VARY, **REQUEST, out=tmp_path / "file")


def test_a_script_without_a_guard_is_told_so(tmp_path):
    lines = (
        "import blockmech as bm",
        f"mech = bm.Graph.load({str(GRAPHS / 'ruiz_fourbar.json')!r}).compile()",
        "mech.study({'dyad.l_i': [6.0]}, want='max(crank.drive)', samples=3, workers=1)",
    )
    script = tmp_path / "script.py"
    script.write_text("\n".join(lines), encoding="utf-8")
    result = subprocess.run([sys.executable, str(script)], capture_output=True, text=True)
    assert result.returncode == 1
    assert "[workers-died] workers: the processes ended before" in result.stderr
    assert 'ask below "if __name__ == ...", and see' in result.stderr


# ---- what stands in a part's place ---------------------------------------------------------


def copied(path, other):
    path.write_bytes(other.read_bytes())


def foreign(path, other):
    import pandas

    pandas.DataFrame({"x": [1.0]}).to_parquet(path)


def flipped(path, other):
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1  # among the pages, not in the footer
    path.write_bytes(data)


def linked(path, other):
    path.unlink()
    path.symlink_to(other)


HARM = {
    "copied": copied,
    "foreign": foreign,
    "flipped": flipped,
    "linked": linked,
    "truncated": lambda path, other: path.write_bytes(path.read_bytes()[:-40]),
    "empty": lambda path, other: path.write_bytes(b""),
    "text": lambda path, other: path.write_text("a,b\n", encoding="utf-8"),
}


@pytest.mark.parametrize("harm", HARM.values(), ids=HARM)
def test_a_part_that_is_none_is_done_again(fourbar, whole, tmp_path, harm):
    fourbar.study(VARY, **REQUEST, out=tmp_path)
    before = files(tmp_path)
    other, path = (tmp_path / name for name in list(before)[1:3])
    harm(path, other)
    done = []
    again = fourbar.study(VARY, **REQUEST, out=tmp_path, progress=lambda *x: done.append(x[1]))
    assert done == [REQUEST["sampling"].count]
    assert_same(whole, again)
    assert files(tmp_path) == before
    assert f"1 damaged part done again: {path.name}" in str(again)


def test_a_folder_in_a_parts_place_is_refused_by_name(fourbar, tmp_path):
    fourbar.study(VARY, **REQUEST, out=tmp_path)
    before = files(tmp_path)
    path = tmp_path / next(iter(before))
    path.unlink()
    path.mkdir()
    with pytest.raises(bm.RequestError, match=rf"{path.name}: it is a directory"):
        fourbar.study(VARY, **REQUEST, out=tmp_path)


def test_parts_that_go_before_they_are_read_are_named(fourbar, tmp_path):
    study = fourbar.study(VARY, **REQUEST, out=tmp_path)
    next(iter(tmp_path.glob("*.parquet"))).unlink()
    with pytest.raises(bm.RequestError, match="cannot be read any more"):
        study["max_abs(crank.drive)"]


def law_of(slope):
    """A moment that follows the rate, by a function that closes over a number."""
    return lambda rate: slope * rate


def with_law(law):
    g = bm.Graph.load(GRAPHS / "ruiz_fourbar.json")
    g.add("motor", bm.Motor(law=law))
    wire(g, "frame.A motor.a", "crank.crank motor.b")
    return g.compile()


def test_a_function_of_python_is_part_of_the_question(tmp_path):
    request = {"want": "max(crank.drive)", "samples": 6, "out": tmp_path}
    designs = {"dyad.l_i": [6.0, 6.1]}
    right = with_law(law_of(-1.0)).study(designs, **request)
    assert_same(right, with_law(law_of(-1.0)).study(designs, **request))
    for law in (law_of(-1.5), lambda rate: 1.0 - rate):
        with pytest.raises(bm.RequestError, match="parts of another question"):
            with_law(law).study(designs, **request)


def test_a_function_that_other_processes_cannot_have_is_refused(tmp_path):
    with pytest.raises(bm.RequestError, match="at the top of a module"):
        with_law(law_of(-1.0)).study({"dyad.l_i": [6.0]}, want="max(crank.drive)", workers=2)


def test_what_a_law_reads_must_be_comparable(tmp_path):
    stream = iter([1.0])
    machine = with_law(lambda rate: rate if stream else -rate)
    with pytest.raises(bm.RequestError, match="reads a list_iterator"):
        machine.study({"dyad.l_i": [6.0]}, want="max(crank.drive)", samples=6, out=tmp_path)


def test_a_changed_file_of_a_graph_inside_is_another_question(tmp_path):
    inner = bm.Graph("knee")
    inner.add("dyad", bm.RRR(l_i=6.0, l_j=3.0))
    outer = bm.Graph("legs")
    outer.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (5.5, 0.0)}))
    outer.add("crank", bm.Crank(length=2.0))
    inner.save(tmp_path / "knee.json")
    outer.add("knee", bm.Subgraph(file=str(tmp_path / "knee.json")))
    wire(outer, "frame.A crank.A", "crank.B knee.dyad.B", "frame.D knee.dyad.D")
    outer.save(tmp_path / "legs.json")
    request = {"want": "max(knee.dyad.i.angle)", "out": tmp_path / "parts"}
    request["at"] = {"crank": [0.1, 0.2]}
    bm.Graph.load(tmp_path / "legs.json").compile().study({"crank.length": [1.9, 2.0]}, **request)
    inner.replace({"dyad.l_i": 6.4}).save(tmp_path / "knee.json")
    changed = bm.Graph.load(tmp_path / "legs.json").compile()
    with pytest.raises(bm.RequestError, match="parts of another question"):
        changed.study({"crank.length": [1.9, 2.0]}, **request)


def test_a_part_rewritten_by_another_program_is_done_again(fourbar, whole, tmp_path):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    fourbar.study(VARY, **REQUEST, out=tmp_path)
    path = sorted(tmp_path.glob("*.parquet"))[0]
    table = parquet.read_table(path)
    i = next(k for k, name in enumerate(table.column_names) if name.startswith("max"))
    name, column = table.column_names[i], table.columns[i].to_numpy()
    parquet.write_table(table.set_column(i, name, arrow.array(1.01 * column)), path)
    assert_same(whole, fourbar.study(VARY, **REQUEST, out=tmp_path))
