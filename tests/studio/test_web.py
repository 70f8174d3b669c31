"""The page's own modules: types, and tests that Node runs."""

import shutil
import subprocess
from pathlib import Path

import pytest

import blockmech as bm
import blockmech.exchange
from blockmech import editor

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
WEB = Path(editor.__file__).parent / "web"
SHARED = Path(bm.exchange.__file__).parent / "page" / "web"
TSC = ROOT / ".ci" / "node_modules" / ".bin" / "tsc"
NODE = shutil.which("node")


@pytest.mark.skipif(NODE is None, reason="there is no Node")
def test_the_pure_modules_by_node():
    process = subprocess.run(
        [NODE, "--test", HERE / "web" / "lib.test.mjs"], capture_output=True, text=True
    )
    assert process.returncode == 0, process.stdout[-3000:]


@pytest.mark.skipif(not TSC.exists(), reason="TypeScript is not installed: see .ci/run")
@pytest.mark.parametrize("folder", [WEB, SHARED], ids=["studio", "page"])
def test_types_of_the_page(folder):
    process = subprocess.run([TSC, "-p", folder / "tsconfig.json"], capture_output=True, text=True)
    assert process.returncode == 0, process.stdout


def test_nothing_of_the_page_comes_from_elsewhere_or_is_markup():
    for path in (*WEB.rglob("*.*"), *SHARED.rglob("*.*")):
        text = path.read_text("utf-8")
        assert "innerHTML" not in text, path
        assert "eval(" not in text, path
        outside = text.replace("http://www.w3.org/2000/svg", "")
        assert "http://" not in outside, path
        assert "https://" not in outside, path
