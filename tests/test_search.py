"""The site's search finds the right page first for the words that designers use.

The site is built without running its examples; its index is searched by lunr, as in the browser.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("material", reason="the site's generator, extra docs")
NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(NODE is None, reason="needs node for the search of the browser")
ROOT = Path(__file__).parents[1]

WORDS = {
    "faq": "torque,rpm,excel,grashof,flywheel,degrees,cite,velocity,simulink,matlab,animation,"
    "self-locking,counterweight,coupler curve",
    "glossary": "DOF,gruebler,singularity,toggle position,inverse dynamics,"
    "forward dynamics,equivalent inertia,limit cycle,parameter sweep",
    "motion": "dead centre",
    "gallery": "quick return,hydraulic,mechanical advantage",
    "limits": "three dimensions,flexible",
    "exchange": "dxf,arduino,freecad,fmu,mujoco",
    "couplings": "gear,cam,belt",
    "sizing": "spring,motor",
    "synthesis": "synthesis,transmission angle",
    "signals": "pid,actuator",
    "designs": "tolerance",
    "vibration": "vibration",
    "forces": "friction,clearance,stribeck",
}
CASES = [(word, page) for page, words in WORDS.items() for word in words.split(",")]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Word -> the first pages."""
    home = tmp_path_factory.mktemp("site")
    (home / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "docstrings.py", home / "docs")  # which the settings name
    settings = {"INHERIT": str(ROOT / "mkdocs.yml"), "docs_dir": str(ROOT / "docs"), "hooks": []}
    settings["site_dir"] = str(home / "site")
    (home / "mkdocs.yml").write_text(json.dumps(settings), "utf-8")  # JSON is YAML
    command = [sys.executable, "-m", "mkdocs", "build", "-q", "-f", str(home / "mkdocs.yml")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=600)
    assert done.returncode == 0, done.stderr[-2000:]
    import mkdocs.contrib.search as plugin

    lunr = Path(plugin.__file__).parent / "templates" / "search" / "lunr.js"
    index = home / "site" / "search" / "search_index.json"
    words = [word for word, _ in CASES]
    search = [NODE, str(ROOT / "tests" / "search.js"), str(lunr), str(index), *words]
    done = subprocess.run(search, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def test_there_are_forty_words():
    assert len(dict(CASES)) == len(CASES) >= 40


@pytest.mark.parametrize(("word", "page"), CASES, ids=[word for word, _ in CASES])
def test_the_right_page_is_found_first(found, word, page):
    assert found[word][:1] == [f"{page}.html"], found[word]
