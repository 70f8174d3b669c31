"""What a user writes is typed: the README's programs pass, a slip is an error before it runs."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import blockmech as bm

ROOT = Path(__file__).resolve().parents[1]

BEGIN = """import blockmech as bm
g = bm.Graph.load("graphs/ruiz_fourbar.json")
mech = g.compile()
m = bm.Linkage("four-bar")
"""
CONSTRUCTORS = """import numpy as np
import blockmech as bm

links = {"i": bm.Link(mass=1.0, cm=(3.0, 0.0), markers={"S": (1.0, 2.0)})}
drive = {"crank": bm.motion.ConstantRate(rate=10.0, start=0.0, end=1.0)}
g = bm.Graph("typed", gravity=(0.0, -9.81), drive=drive)
pivot = bm.Marker(at=(5.5, 0.0), dir=(0.0, 1.0))
g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": pivot, "E": 1 + 2j, "F": [1.0, 2.0]}))
g.add("dyad", bm.RRR(l_i=6.0, l_j=3.0, branch=-1, links=links))
g.add("weight", bm.Force(force=(0.0, -1000.0)))
place: complex = pivot.at.z
crank = bm.Crank(length="50 mm", offset="30deg")
length: float | None = crank.length
rocker = bm.RRR(l_i="1/2 in", l_j=3.0, links={"i": bm.Link(mass="2 kg", cm=("5 mm", 0.0))})
bearing = bm.friction.Coulomb(coefficient=0.1, radius="5 mm")
belt = bm.Belt(driver="a", driven="b", radii=("30 mm", "90 mm"), preload="0.2 kN")
spring = bm.Spring(stiffness="5 N/mm", free_length="50 mm")
law = bm.motion.ConstantRate(rate="300rpm", end="1 turns")
guide = bm.Marker(at=("50 mm", "2 cm"), angle="30deg")
m = bm.Linkage("typed")
m.add_link("arm", pose=(0.0, "2 cm", "30deg"), mass="2 kg", markers={"tip": ("5 cm", 0.0)})
m.add_joint("O", "R", ["frame", "arm"], point=("5 mm", 0.0), clearance="0.1 mm")
m.add_stop("motor", "-30deg", high="80deg")
m.start("motor", q="30deg", rate="300rpm")
at: list[complex] = [place.z for place in m.joints["O"].at]
times = bm.motion.Trajectory(times=np.linspace(0.0, 1.0, 5), values=[0.0, 1.0, 2.0, 3.0, 4.0])
"""
RIGHT = (
    'g.run(at=range(3), want="crank.drive", friction="single")',
    'm.add_load("wind", bm.Force(force=(1.0, 0.0)), link="rod", at=(1.0, 0.0))',
    'm.add_joint("A", "R", ["frame", "crank"], at=[(0.0, 0.0), 1 + 2j])',
    'answer: bm.Result = mech.simulate("time=2", watch=[bm.Watch("half", lambda t, q, r: t - 1)])',
    'bm.draw.draw(mech, "picture.png", "mechanism")',
    "made: bm.Mechanism = g.run(at=0.0).mechanism",
    'moved: bm.Mechanism = mech.simulate("time=2").mechanism',
    'end: str = mech.simulate("time=2").motion.end',
    "chosen: str = how.friction if (how := g.run(at=0.0, accuracy=1e-3).accuracy) else ''",
    'mech.limits().to("rad").plot("arcs.svg")',
    'g.draw("fourbar.svg")',
    'g.run(at="30deg", rates="300rpm").to("deg", "kN").plot()',
    'mech.study({"dyad.l_i": [1.0]}, want="crank.drive").figure()',
    "bm.synthesis.path_generator([(0.0, 0.0), (1.0, 0.2), (2.0, 0.0)], angles=[0.0, 1.0, 2.0])",
)
WRONG = (
    'bm.Force(force="down")',
    "bm.Crank(length=[1.0])",
    "bm.Crank(length=None, offset=None)",
    'g.run(at=0.0, frictoin="none")',
    'g.run(at=0.0, friction="nwton")',
    'm.run(at=0.0, on_gap="skip")',
    "mech.run(at=object())",
    'mech.run(at=0.0, engine="numppy")',
    'mech.simulate("time=2", method="dop83")',
    'mech.simulate("time=2", tims=[1.0])',
    "mech.simulte()",
    'mech.trade("runs")',
    "g.run(at=0.0).mechanism.limts()",
    'mech.simulate("time=2").motion.ends',
    "g.run(at=0.0).motion.end",  # a run has none
    'mech.limits().plot("arcs.svg", degree=True)',
    'bm.laod("graphs/ruiz_fourbar.json")',
    'mech.trade("run", sample=5)',
    "mech.limits(drivr='crank')",
    "mech.verify(sample=3)",
    'mech.extremes("crank.drive", friction="no")',
    "mech.modes(arc=False)",
    'm.add_link("rod", mas=1.0)',
    'm.add_joint("A", "Q", ["frame", "crank"], at=[(0.0, 0.0), (0.0, 0.0)])',
    'm.add_load("wind", bm.Force(force=(1.0, 0.0)), lnk="rod")',
    "bm.synthesis.path_generator(3.0)",
)


def test_programs_of_the_readme_pass_and_slips_do_not(tmp_path: Path) -> None:
    pytest.importorskip("mypy", reason="mypy checks types; it comes with the extra dev")
    readme = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    good, made, bad = (tmp_path / f"{name}.py" for name in ("good", "made", "bad"))
    good.write_text("\n".join([*readme, BEGIN, *RIGHT]), "utf-8")
    made.write_text(CONSTRUCTORS, "utf-8")
    bad.write_text("\n".join([BEGIN, *WRONG]), "utf-8")
    cache = ROOT / ".mypy_cache"  # of a check of src, which would take seconds again
    cache_folder = cache if cache.exists() else tmp_path / "cache"
    result = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", f"--cache-dir={cache_folder}", good, made, bad],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "MYPYPATH": str(ROOT / "src")},
    )
    assert not re.search(r"(good|made)\.py:\d+: error", result.stdout), result.stdout
    refused = {int(n) for n in re.findall(r"bad\.py:(\d+): error", result.stdout)}
    first = BEGIN.count("\n") + 2
    assert refused == set(range(first, first + len(WRONG))), result.stdout
    assert (ROOT / "src" / "blockmech" / "py.typed").exists()  # so are installed packages read


def test_few_values_are_of_any_type() -> None:
    files = (ROOT / "src").rglob("*.py")
    lines = [line for file in files for line in file.read_text("utf-8").splitlines()]
    assert sum(re.search(r"\bAny\b", line) is not None for line in lines) <= 900


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        (bm.Graph.run, ("friction", "accuracy", "[rad or m]", "RequestError")),
        (bm.Linkage.run, ("friction", "on_gap")),
        (bm.Mechanism.simulate, ("until", "dop853", "[rad or m]")),
        (bm.Mechanism.trade, ("budget", "[s]")),
        (bm.Mechanism.verify, ("samples", "static")),
        (bm.Mechanism.limits, ("driver", "[rad or m]")),
        (bm.Mechanism.modes, ("groups", "arcs")),
        (bm.Mechanism.extremes, ("friction", "vector")),
        (bm.Linkage.add_link, ("pose", "[kg]")),
        (bm.Linkage.add_joint, ("slider", "[rad]")),
    ],
)
def test_help_names_and_explains_every_argument(method: object, expected: tuple[str, ...]) -> None:
    signature = inspect.signature(method)  # type: ignore[arg-type]
    text = inspect.getdoc(method) or ""
    kinds = {p.kind for p in signature.parameters.values()}
    assert not kinds & {inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL}
    names = [n for n in signature.parameters if n not in ("self", "mechanism", "name")]
    assert [n for n in names if not re.search(rf"\b{n}\b", text)] == []
    assert [word for word in expected if word not in text] == []
