"""A page in a browser, and what a user does there."""

import re
from pathlib import Path

import pytest

AXE = Path(__file__).parents[2] / ".ci" / "node_modules" / "axe-core" / "axe.min.js"


def show(page, studio, what):
    """Open an address of the studio and wait until the sheet stands."""
    opened(page, studio, what)
    page.wait_for_selector(".diagram svg")
    page.wait_for_function("Bokeh.documents[0].is_idle")


LINK = """to => {
    const link = Object.assign(document.createElement("a"), { href: to });
    document.body.append(link);
    link.click();
    link.remove();
}"""


def opened(page, studio, what):
    """Go to an address of the studio: by a link where a page of it stands, whose scripts are parsed
    already. Its colours are those of a page, so they need a new one.
    """
    here = page.url
    if "theme" in here + what or not here.startswith(studio[0]):
        page.goto(studio[0] + what)
        return
    page.evaluate(LINK, what)
    page.wait_for_url(lambda url: url != here)


def press(page, name):
    page.get_by_role("button", name=name, exact=True).click()


def fill(page, label, value):
    field = page.get_by_label(label, exact=True)
    field.fill(value)
    field.press("Enter")


def rename(page, name):
    """Rename the block whose form is shown, and wait until the canvas shows it."""
    fill(page, "Name", name)
    page.locator(f'.block[data-id="{name}"]').wait_for()


def choose(page, label, value):
    page.get_by_label(label, exact=True).select_option(value)


def edit(page, block):
    """Choose a block whose form is shown."""
    from playwright.sync_api import expect

    choose(page, "Edit", block)
    expect(page.get_by_label("Name", exact=True)).to_have_value(block)


def told(page, text):
    page.get_by_role("status").get_by_text(text, exact=True).wait_for()


def blocks(page):
    return page.locator(".diagram .block")


def add(page, word):
    """Press a kind of the palette."""
    count = blocks(page).count()
    press(page, f"Add {word}")
    blocks(page).nth(count).wait_for()


def drop(page, kind, x, y):
    """Drag a kind of block from the palette to a place on the canvas."""
    count = blocks(page).count()
    canvas = page.locator(".diagram svg")
    page.locator(f'button[data-kind="{kind}"]').drag_to(canvas, target_position={"x": x, "y": y})
    blocks(page).nth(count).wait_for()


def drag_block(page, name):
    """Drag a block of the canvas a little down; all blocks then stay where they are."""
    x, y = middle(page.locator(f'.block[data-id="{name}"]'))
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y + 20, steps=4)
    page.mouse.up()
    told(page, f"{name} moved")


def connect(page, source, target):
    """Wire a joint in the form of its block."""
    edit(page, target.partition(".")[0])
    choose(page, f"wire to {target}", source)
    wire_between(page, source, target).wait_for(state="attached")


def port(page, side, address):
    block, name = address.split(".")
    return page.locator(f'.handle.{side}[data-block="{block}"][data-port="{name}"]')


def wire_between(page, source, target):
    return page.locator(f'.wire[data-id="{source} -> {target}"]')


def hidden_wires(page):
    """The wires that run behind a block on the canvas."""
    return page.locator(".diagram svg")._evaluate(
        """(view) => {
            const areas = [...view.querySelectorAll(".body")]
                .map((node) => node.getBoundingClientRect());
            const under = (path) => {
                const [place, n] = [path.getScreenCTM(), path.getTotalLength()];
                return Array.from({length: 200}, (_, k) => path.getPointAtLength(k * n / 199))
                    .map((point) => point.matrixTransform(place))
                    .some(({x, y}) => areas.some((area) => x > area.left + 2 && x < area.right - 2
                        && y > area.top && y < area.bottom));
            };
            return [...view.querySelectorAll(".wire")]
                .filter((wire) => under(wire.querySelector(".line")))
                .map((wire) => wire.dataset.id);
        }"""
    )


def middle(locator):
    while (box := locator.bounding_box()) is None:  # it is drawn anew at this moment
        locator.wait_for(state="visible")
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag_wire(page, source, target):
    """Drag a wire from a marker to above a joint, until the server has said whether it may be."""
    end = port(page, "target", target)
    port(page, "source", source).hover()  # as soon as nothing is before it
    page.mouse.down()
    page.mouse.move(*middle(end), steps=4)
    said = end.and_(page.locator(".valid, .refused"))
    said.wait_for()
    return said


def wire(page, source, target):
    """Draw a wire from a marker to a joint, as somebody who looks where the blocks are."""
    from playwright.sync_api import expect

    page.get_by_label("Fit View").click()
    expect(drag_wire(page, source, target)).to_have_class(re.compile("valid"))
    page.mouse.up()
    wire_between(page, source, target).wait_for(state="attached")
    told(page, f"{source} -> {target}")  # the server knows it, and what it changed was sent


def save(page, name):
    fill(page, "File", name)
    page.get_by_role("button", name=re.compile("^Saved?$")).click()
    told(page, f"wrote {name}")


class Hand:
    """A pointer over the drawing, which counts what it does."""

    def __init__(self, page):
        self.page, self.acts = page, 0
        self.area = page.locator("svg[role=application]").bounding_box()

    def at(self, x, y):
        """A place of the drawing, both from 0 to 1, in pixels."""
        return (
            self.area["x"] + x * self.area["width"],
            self.area["y"] + y * self.area["height"],
        )

    def pin(self, name):
        return middle(self.page.locator(f'[data-pin="{name}"] .ring'))

    def drag(self, start, end, typed=""):
        self.acts += 1
        self.page.mouse.move(*start)
        self.page.mouse.down()
        self.page.mouse.move(*end, steps=4)
        if typed:
            self.page.keyboard.type(typed)
        self.page.mouse.up()

    def link(self, start, end, new, typed=""):
        """Draw a link that ends at a new pin."""
        self.drag(start, end, typed)
        self.page.locator(f'[data-pin="{new}"]').wait_for()

    def click(self, name, **how):
        self.acts += 1
        self.page.locator(f'[data-pin="{name}"] .ring').click(**how)

    def key(self, name):
        self.acts += 1
        self.page.locator("svg[role=application]").press(name)

    def press(self, name, said):
        self.acts += 1
        press(self.page, name)
        self.page.get_by_role("status").get_by_text(said).wait_for()


def drawing(page, studio):
    """An empty drawing of links and joints."""
    opened(page, studio, "?draw")
    page.get_by_text("Drag: a link is drawn").wait_for()
    page.wait_for_function("Bokeh.documents[0].is_idle")
    return Hand(page)


def accessible(page, *rules):
    """Let axe look at what is shown, by all of its rules or some."""
    if not AXE.exists():
        pytest.skip("axe-core is not installed: npm install --no-save --prefix .ci axe-core")
    page.wait_for_function("Bokeh.documents[0].is_idle")
    page.evaluate(AXE.read_text("utf-8"))
    only = {"runOnly": list(rules)} if rules else {}
    found = page.evaluate(
        "how => axe.run(document, how)",
        {"resultTypes": ["violations", "passes"], "preload": False, **only},
    )
    bad = [
        (rule["id"], node["html"])
        for rule in found["violations"]
        if rule["impact"] in ("serious", "critical")
        for node in rule["nodes"]
    ]
    assert bad == [], bad
    assert "color-contrast" in {rule["id"] for rule in found["passes"]}


STEPS = """async ([add, diagram, times]) => {
    const count = () => diagram.querySelectorAll(".block").length;
    const undo = { key: "z", ctrlKey: true, bubbles: true };
    const changed = async (act) => {
        const before = count();
        act();
        for (let k = 0; k < 3000 && count() === before; k++)
            await new Promise((done) => setTimeout(done, 10));
        return count() !== before;
    };
    for (let k = 0; k < times; k++) {
        if (!(await changed(() => add.click()))) return "not added";
        if (!(await changed(() => diagram.dispatchEvent(new KeyboardEvent("keydown", undo)))))
            return "not undone";
    }
    return "done";
}"""


def heap_around(page, studio, edits):
    """Bytes that the page holds before and after edits of a four-bar: a block is added and gone."""
    show(page, studio, "?example=ruiz_fourbar")
    add = page.get_by_role("button", name="Add spring", exact=True).element_handle()
    diagram = page.locator(".diagram svg").element_handle()
    tools = page.context.new_cdp_session(page)

    def heap():
        tools.send("HeapProfiler.collectGarbage")
        return tools.send("Runtime.getHeapUsage")["usedSize"]

    assert page.evaluate(STEPS, [add, diagram, 3]) == "done"
    before = heap()
    assert page.evaluate(STEPS, [add, diagram, edits // 2]) == "done"
    return before, heap()
