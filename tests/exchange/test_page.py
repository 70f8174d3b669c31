"""Pages without a server: the numbers of a browser are those of Python, and texts run nothing."""

import json
import random
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.editor.revision import Revision
from blockmech.editor.sheets import link_of, packed
from blockmech.exchange.page.files import bundle
from blockmech.exchange.page.script import WEB, Script, numbers
from tests.studio.conftest import ARGUMENTS, chromium, driver

GRAPHS = Path(__file__).parents[2] / "graphs"
POSES = 1000


@pytest.fixture(scope="module")
def browser():
    options = {"executable_path": chromium(), "headless": True, "args": ARGUMENTS}
    running = driver().chromium.launch(**options)
    yield running
    running.close()


@pytest.fixture
def page(browser):
    """A window in which no script fails and which loads nothing."""
    page, wrong = browser.new_page(viewport={"width": 1280, "height": 800}), []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "console", lambda message: wrong.append(message.text) if message.type == "error" else None
    )
    page.on("request", lambda request: _note(request.url, wrong))
    yield page
    page.close()
    assert wrong == []


def _note(url, wrong):
    if not url.startswith(("file:", "data:", "blob:")):
        wrong.append(url)


def written(folder, name, **options):
    path = folder / "page.html"
    bm.write(opened(GRAPHS / f"{name}.json"), path, **options)
    return path


def readme_crank(**rod):
    """The slider-crank of the README, with a couple."""
    m = bm.Linkage("slider_crank")
    m.add_link("crank")
    m.add_link("rod", **rod)
    m.add_link("piston")
    m.add_joint("O", "R", ["frame", "crank"], point=(0, 0))
    m.add_joint("A", "R", ["crank", "rod"], point=(0.03, 0.04))
    m.add_joint("B", "R", ["rod", "piston"], point=(0.228, 0))
    m.add_joint("cylinder", "P", ["frame", "piston"], point=(0.228, 0))
    m.add_driver("motor", "O", bm.motion.ConstantRate(rate=150.0))
    m.add_load("gas", "force", link="piston", at=(0.228, 0), force=(-2000, 0))
    m.add_load("brake", "couple", link="crank", moment=-3.0)
    return m


def test_sines_of_a_page_are_rounded_correctly(page):
    """Against 40 digits: the error is half a unit of the last place."""
    mp = pytest.importorskip("mpmath")
    draw = random.Random(5)
    angles = [draw.uniform(-7, 7) for _ in range(1500)] + [
        draw.uniform(-3e3, 3e3) for _ in "x" * 500
    ]
    points = [(draw.gauss(0, 1), draw.gauss(0, 1)) for _ in range(1500)]
    page.goto("about:blank")
    page.add_script_tag(content=numbers())
    result = page.evaluate(
        """([a, p]) => [
            a.map(sin), a.map(cos), p.map((z) => atan2(...z)), p.map((z) => hypot(...z))]""",
        [angles, points],
    )
    with mp.workdps(40):
        exact = [
            [float(mp.sin(x)) for x in angles],
            [float(mp.cos(x)) for x in angles],
            [float(mp.atan2(*z)) for z in points],
            [float(mp.hypot(*z)) for z in points],
        ]
    assert result == exact


@pytest.mark.parametrize(
    ("name", "want"),
    [
        ("ruiz_fourbar", ["crank.drive", "dyad.C.reaction", "dyad.j.omega"]),
        ("slider_crank_offset", ["*.drive", "*.p", "*.angle"]),
        ("watt_sixbar", ["*.drive", "*.omega"]),
        ("excavator", ["*.drive", "*.reaction"]),
        ("joints/engine", ["driver.shaft.drive", "joint.*.reaction"]),
        ("geared_fivebar", ["*.drive", "*.p"]),
    ],
)
def test_a_browser_has_the_numbers_of_python(page, tmp_path, name, want):
    """1,000 poses: within 2 units of the last place of the largest number of each output."""
    mechanism = opened(GRAPHS / f"{name}.json").compile()
    script = Script(mechanism, want)
    try:
        samples = mechanism.samples(None, POSES, None, None, None)
    except bm.RequestError:
        samples = mechanism.samples(None, None, np.linspace(0, 1, POSES), None, None)
    values, _ = mechanism._evaluate(script.plan, samples, "scalar")
    from blockmech.result.result import Result

    result = Result(mechanism, script.plan, samples, values, "", {"friction": "newton"})
    expected = np.array(script.answers(result))
    page.goto("about:blank")
    page.add_script_tag(content=bundle(WEB / "program.js"))
    found = page.evaluate(
        """([text, p, rows, n]) => {
            const own = new $program.Program(text, p.length, rows[0].length, n);
            const out = new Float64Array(n);
            return rows.map((u) => (own.run(p, u, out), Array.from(out, String)));
        }""",
        [script.compact(), script.values, script.rows(samples), len(script.outputs)],
    )
    found = np.array([[float(x.replace("Infinity", "inf")) for x in row] for row in found])
    assert found.shape == (POSES, len(script.outputs))
    finite = np.isfinite(expected)
    assert finite.any()
    assert (np.isfinite(found) == finite).all()
    size = np.max(np.abs(np.where(finite, expected, 0)), axis=0)
    off = np.abs(np.where(finite, found - expected, 0)) / np.spacing(np.where(size > 0, size, 1))
    same = np.mean((found == expected)[finite])
    print(f"{name}: {100 * same:.2f} % the same bits, at most {off.max():.1f} units off")
    assert off.max() <= 2


def readings(page):
    """The first output, and how far right pins are [px], in all poses, as the page shows them."""
    rows = page.evaluate(
        """() => {
            const slider = document.querySelector("main input[type=range]");
            return Array.from({ length: Number(slider.max) + 1 }, (_, k) => {
                slider.value = k;
                slider.dispatchEvent(new Event("input"));
                const across = [...document.querySelectorAll(".dot")].map(
                    (pin) => Number(pin.getAttribute("transform").match(/[-\\d.]+/)[0]));
                const text = document.querySelector(".values dd").textContent;
                return [Number(text.split(" ")[0].replace("\\u2212", "-")), ...across];
            });
        }"""
    )
    values, *across = np.array(rows).T
    return values, across


def test_a_page_moves_and_a_number_is_changed(page, tmp_path):
    """Numbers are those of another run; pixels are a scale and an origin of what it has."""
    path = written(tmp_path, "slider_crank", slider="piston.l, gas.force.x")
    page.goto(path.as_uri())
    assert page.locator("path.curve").get_attribute("d").startswith("M")
    data = json.loads((GRAPHS / "slider_crank.json").read_text("utf-8"))
    data["blocks"]["piston"]["l"] = 0.3
    drive = bm.Graph.from_data(data).run(samples=181, want=["crank.drive"])["crank.drive"]
    field = page.get_by_label("piston.l", exact=False).first
    field.fill("0.3")
    field.press("Enter")
    values, (*_, across) = readings(page)
    assert values == pytest.approx(drive, rel=1e-11, abs=1e-9)
    q = np.linspace(0, 2 * np.pi, 181)
    x = 0.05 * np.cos(q) + np.sqrt(0.09 - (0.05 * np.sin(q)) ** 2)
    scale = np.polyfit(x, across, 1)
    assert scale[0] > 100
    assert np.abs(np.polyval(scale, x) - across).max() < 0.1  # [px], of which it writes tenths
    page.get_by_role("button", name="Play").click()
    slider = page.get_by_label("Pose", exact=True)
    while int(slider.input_value()) < 5:
        page.wait_for_timeout(20)
    page.get_by_role("button", name="Pause").click()


def test_sliders_move_any_number_of_a_drawing(page, tmp_path):
    """Lengths follow the places of pins as the decomposition has them, several at once."""
    m = readme_crank(mass=0.5, inertia=2e-3, cm=(0.129, 0.02))
    path = tmp_path / "page.html"
    changes = {"joints.A.at[0].x": 0.035, "joints.B.at[0].x": 0.24, "links.rod.mass": 0.8}
    changes |= {"loads.gas.force.x": -2500.0, "links.rod.cm.y": 0.03}
    bm.write(m, path, slider=",".join(changes))
    page.goto(path.as_uri())
    for address, value in changes.items():
        field = page.get_by_label(address, exact=False).first
        field.fill(str(value))
        field.press("Enter")
    drive = m.replace(changes).run(samples=181)["driver.motor.drive"]
    values, _ = readings(page)
    assert values == pytest.approx(drive, rel=1e-11, abs=1e-9)


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("links.rod.pose[0]", "only tells the assembly mode"),
        ("drivers.motor.rate", "how the drivers move"),
        ("links.rod.lenght", "no parameter with that address"),
    ],
)
def test_a_slider_for_what_a_page_cannot_follow_is_refused(tmp_path, address, why):
    with pytest.raises(bm.RequestError, match=why):
        bm.write(readme_crank(), tmp_path / "page.html", slider=address)


@pytest.mark.parametrize("address", ["dimensions.rod.value", "joints.A.at[0].x"])
def test_a_page_fits_no_drawing_to_its_dimensions(tmp_path, address):
    """A fit is solved step by step; masses of such a drawing have sliders."""
    m = readme_crank(mass=0.5)
    m.add_dimension("rod", "length", ["A", "B"], "210mm")
    with pytest.raises(bm.RequestError, match=r"fits no drawing to its dimensions\. take"):
        bm.write(m, tmp_path / "page.html", slider=address)
    bm.write(m, tmp_path / "page.html", slider="links.rod.mass, loads.gas.at.x")


def test_a_page_has_the_links_names_and_loads_of_the_drawing(page, tmp_path):
    """The slider-crank of the README: links between their own pins, a force along -x."""
    m = readme_crank()
    path = tmp_path / "page.html"
    bm.write(m, path, want=["driver.motor.drive"])
    page.goto(path.as_uri())
    page.locator("html[data-ready]").wait_for(state="attached")
    names = page.locator(".canvas text").all_text_contents()
    assert set(names) == {"O", "A", "B, cylinder, piston", "crank", "rod", "gas", "brake"}
    a, b, o = sorted(  # pixels of the pins, from the top
        page.locator(".dot").evaluate_all(
            "pins => pins.map((x) => x.getCTM()).map(({ e, f }) => [e, f])"
        ),
        key=lambda z: (z[1], -z[0]),
    )
    bars = page.locator("polygon.link").evaluate_all(
        "links => links.map((x) => [...x.points].map((z) => [z.x, z.y]))"
    )
    assert [sorted(bar) for bar in bars[:2]] == [
        [pytest.approx(z, abs=0.2) for z in sorted(ends)] for ends in ([o, a], [a, b])
    ]
    brake, gas = page.locator("path.force").evaluate_all(
        "forces => forces.map((x) => x.getCTM()).map(({ a, d, e }) => ({ a, d, e }))"
    )
    assert (gas["a"], gas["e"]) == pytest.approx((-1, b[0]), abs=0.2)  # it points to the left
    assert brake["d"] == -1  # it turns to the right
    assert page.get_by_label("at crank A x [m]", exact=True).input_value() == "0.03"


def test_lengths_of_a_page_are_in_the_unit_that_is_chosen(page, tmp_path):
    """A result in mm is opened in mm; the fields of numbers, values and axes follow a choice."""
    m, path = readme_crank(), tmp_path / "page.html"
    result = m.run(samples=9, want=["joint.B.p", "driver.motor.drive"]).to("mm")
    bm.write(result, path, slider="joints.A.at[0].x")
    page.goto(path.as_uri())
    unit, values = page.get_by_label("Lengths in"), page.locator(".values dd")
    at_start = complex(m.run(samples=9)["joint.B.p"][0])
    assert unit.input_value() == "mm"
    assert values.first.inner_text() == f"{round(1e3 * at_start.real, 9):g} mm"
    field = page.get_by_label("joints.A.at[0].x [mm]", exact=True)
    field.fill("40")
    field.press("Enter")
    longer = m.replace({"joints.A.at[0].x": 0.04}).run(samples=9)
    assert read_number(values.first) == pytest.approx(1e3 * longer["joint.B.p"][0].real)
    unit.select_option("cm")
    assert page.get_by_label("joints.A.at[0].x [cm]", exact=True).input_value() == "4"
    assert read_number(values.first) == pytest.approx(1e2 * longer["joint.B.p"][0].real)
    assert read_number(values.last) == pytest.approx(longer["driver.motor.drive"][0], abs=1e-9)
    assert "p.x [cm]" in page.locator(".plots").inner_text()
    bm.write(m, path)
    page.goto(path.as_uri())
    assert page.get_by_label("Lengths in").input_value() == "m"
    assert page.get_by_label("Another number").locator("option").first.inner_text() == "choose …"


def read_number(element):
    return float(element.inner_text().split()[0].replace("\u2212", "-"))


def test_words_of_a_page_lie_beside_blocks_arrows_and_each_other(page, tmp_path):
    bm.write(readme_crank(), tmp_path / "page.html")
    page.set_viewport_size({"width": 1280, "height": 800})
    page.goto((tmp_path / "page.html").as_uri())
    page.locator("html[data-ready]").wait_for(state="attached")
    boxes = page.evaluate(
        """() => [".canvas text", ".canvas .block, .canvas .dot"].map((which) =>
            [...document.querySelectorAll(which)].map((x) => x.getBoundingClientRect().toJSON()))"""
    )

    def apart(a, b):
        across = min(a["right"], b["right"]) - max(a["left"], b["left"])
        return across <= 1 or min(a["bottom"], b["bottom"]) - max(a["top"], b["top"]) <= 1

    labels, shapes = boxes
    assert len(labels) == 7
    assert all(apart(a, b) for k, a in enumerate(labels) for b in (*labels[:k], *shapes))
    (guide,) = page.locator(".rail").all()
    assert guide.bounding_box()["y"] > page.locator(".block").bounding_box()["y"] + 15


def test_a_page_opens_the_link_of_another_mechanism_without_eval(page, tmp_path):
    path = written(tmp_path, "slider_crank")
    text = path.read_text("utf-8")
    assert "unsafe-eval" not in text
    assert "script-src 'sha256-" in text
    four_bar = opened(GRAPHS / "ruiz_fourbar.json")
    mechanism = four_bar.compile()
    link = packed(link_of(Revision(1, four_bar.to_data(), four_bar), ["dyad.C.x"]))
    assert len(link) < 12000
    page.goto(path.as_uri() + link)
    page.locator("html[data-ready]").wait_for(state="attached")
    assert page.get_by_role("heading").inner_text() == four_bar.title
    values, across = readings(page)
    drive = mechanism.run(samples=181, want=["crank.drive"])["crank.drive"]
    assert values == pytest.approx(drive, rel=1e-11, abs=1e-9)
    assert max(map(np.ptp, across)) > 100
    for wrong in ("", "AAAA", link[: len(link) // 2]):
        page.goto("about:blank")
        page.goto(f"{path.as_uri()}#doc={wrong.removeprefix('#doc=')}")
        page.get_by_text("copy the whole link again").wait_for()


def test_a_link_of_what_does_not_move_says_why(page, tmp_path):
    path, empty = written(tmp_path, "slider_crank"), bm.Linkage("four")
    link = packed(link_of(Revision(1, empty.to_data(), empty), []))
    page.goto(path.as_uri() + link)
    page.get_by_text("It is no mechanism yet.").wait_for()
    with page.expect_download() as loading:
        page.get_by_role("link", name="The mechanism's file").click()
    assert bm.Linkage.load(loading.value.path()).name == "four"


def test_texts_of_a_hostile_document_run_nothing_in_a_page(page, tmp_path):
    hurt = "</script><img src=x onerror='window.hurt=1'>\u202e\u2028"
    data = json.loads((GRAPHS / "slider_crank.json").read_text("utf-8"))
    data |= {"title": hurt, "notes": hurt}
    path = tmp_path / "hostile.html"
    bm.write(bm.Graph.from_data(data), path, to="page")
    page.goto(path.as_uri())
    assert page.get_by_role("heading").inner_text().startswith("</script>")
    assert page.evaluate("window.hurt") is None
    link = json.loads(page.locator("#contents").text_content())
    assert json.loads(link["document"])["title"] == hurt


def test_the_command_writes_a_page(tmp_path, call):
    file, target = GRAPHS / "whitworth_shaper.json", tmp_path / "p.html"
    assert str(target) in call("page", file, "-o", target, "--samples", "31").out
    assert '"n": 31' in target.read_text("utf-8")
    outcome = call("page", file, "-o", target, "--slider", "crank.lenght")
    assert outcome.code == 2
    assert "crank.length" in outcome.err
