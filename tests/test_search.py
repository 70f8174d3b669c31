"""The site's search finds the right page first for the words that designers use.

The site is built without running its examples; its index is searched by lunr, as in the browser.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.studio.conftest import driver

pytest.importorskip("material", reason="the site's generator, extra docs")
NODE, CHROMIUM = shutil.which("node"), shutil.which("chromium")
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
    "exchange": "arduino,fmu",
    "importing": "freecad,urdf",
    "quality": "flags,status",
    "units": "inch",
    "norton": "norton",
    "windows": "powershell",
    "notebooks": "jupyter",
    "five_minutes": "slider-crank",
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
def site(tmp_path_factory):
    """The folder of the site, without what its programs would show."""
    home = tmp_path_factory.mktemp("site")
    (home / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "docstrings.py", home / "docs")  # which the settings name
    settings = {"INHERIT": str(ROOT / "mkdocs.yml"), "docs_dir": str(ROOT / "docs"), "hooks": []}
    settings["site_dir"] = str(home / "site")
    (home / "mkdocs.yml").write_text(json.dumps(settings), "utf-8")  # JSON is YAML
    command = [sys.executable, "-m", "mkdocs", "build", "-q", "-f", str(home / "mkdocs.yml")]
    result = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=600)
    assert result.returncode == 0, result.stderr[-2000:]
    return home / "site"


@pytest.fixture(scope="module")
def ranking(site):
    """Word -> the first pages."""
    import mkdocs.contrib.search as plugin

    lunr = Path(plugin.__file__).parent / "templates" / "search" / "lunr.js"
    index = site / "search" / "search_index.json"
    words = [word for word, _ in CASES]
    search = [NODE, str(ROOT / "tests" / "search.js"), str(lunr), str(index), *words]
    result = subprocess.run(search, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr[-2000:]
    return json.loads(result.stdout)


def test_there_are_forty_words():
    assert len(dict(CASES)) == len(CASES) >= 40


@pytest.mark.parametrize(("word", "page"), CASES, ids=[word for word, _ in CASES])
def test_the_right_page_is_found_first(ranking, word, page):
    assert ranking[word][:1] == [f"{page}.html"], ranking[word]


@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium")
def test_search_works_on_pages_that_lie_on_the_disk(site):
    browser = driver().chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
    page = browser.new_page()
    page.goto(f"{(site / 'index.html').as_uri()}?q=flywheel")
    page.wait_for_selector(".md-search-result__link", state="attached")
    links = page.locator(".md-search-result__link").evaluate_all("all => all.map(a => a.href)")
    browser.close()
    assert any("sizing.html" in link for link in links)
