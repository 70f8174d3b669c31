"""A page in a browser, and what a user does there."""

import re
from pathlib import Path

import pytest

AXE = Path(__file__).parents[2] / ".ci" / "node_modules" / "axe-core" / "axe.min.js"


def show(page, studio, what):
    """Open an address of the studio and wait until the sheet stands."""
    page.goto(studio[0] + what)
    page.wait_for_selector(".react-flow__pane")
    page.wait_for_function("Bokeh.documents[0].is_idle")


def press(page, name):
    page.get_by_role("button", name=name, exact=True).click()


def fill(page, label, value):
    field = page.get_by_label(label, exact=True)
    field.fill(value)
    field.press("Enter")


def rename(page, name):
    """Rename the block whose form is shown, and wait until the canvas shows it."""
    fill(page, "Name", name)
    page.locator(f'.react-flow__node[data-id="{name}"]').wait_for()


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
    return page.locator(".react-flow__node")


def add(page, word):
    """Press a kind of the palette."""
    count = blocks(page).count()
    press(page, f"Add {word}")
    blocks(page).nth(count).wait_for()


def drop(page, kind, x, y):
    """Drag a kind of block from the palette to a place on the canvas."""
    count = blocks(page).count()
    canvas = page.locator(".react-flow__pane")
    page.locator(f'button[data-kind="{kind}"]').drag_to(canvas, target_position={"x": x, "y": y})
    blocks(page).nth(count).wait_for()


def drag_block(page, name):
    """Drag a block of the canvas a little down; all blocks then stay where they are."""
    x, y = middle(page.locator(f'.react-flow__node[data-id="{name}"]'))
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
    return page.locator(
        f'.react-flow__handle.{side}[data-nodeid="{block}"][data-handleid="{name}"]'
    )


def wire_between(page, source, target):
    return page.locator(f'.react-flow__edge[data-id="{source} -> {target}"]')


def hidden_wires(page):
    """The wires that run behind a block on the canvas."""
    return page.locator(".react-flow__viewport").evaluate(
        """(view) => {
            const areas = [...view.querySelectorAll(".react-flow__node")]
                .map((node) => node.getBoundingClientRect());
            const under = (path) => {
                const [place, n] = [path.getScreenCTM(), path.getTotalLength()];
                return Array.from({length: 200}, (_, k) => path.getPointAtLength(k * n / 199))
                    .map((point) => point.matrixTransform(place))
                    .some(({x, y}) => areas.some((area) => x > area.left + 1 && x < area.right - 1
                        && y > area.top && y < area.bottom));
            };
            return [...view.querySelectorAll(".react-flow__edge")]
                .filter((edge) => under(edge.querySelector(".react-flow__edge-path")))
                .map((edge) => edge.dataset.id);
        }"""
    )


def middle(locator):
    box = locator.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag_wire(page, source, target):
    """Drag a wire from a marker to above a joint, until the server has said whether it may be."""
    end = port(page, "target", target)
    port(page, "source", source).hover()  # as soon as nothing is before it
    page.mouse.down()
    page.mouse.move(*middle(end), steps=4)
    said = end.and_(page.locator(".rf-handle-valid, .rf-handle-invalid"))
    said.wait_for()
    return said


def wire(page, source, target):
    """Draw a wire from a marker to a joint, as somebody who looks where the blocks are."""
    from playwright.sync_api import expect

    whole_canvas(page)
    end = drag_wire(page, source, target)
    expect(end).to_have_class(re.compile("rf-handle-valid"))
    for shift in (0, 2) * 200:  # it is looked at again where the pointer moves
        x, y = middle(end)
        page.mouse.move(x + shift, y)
        if re.search("connectingto.* valid", end.get_attribute("class")):  # it would be wired
            break
    page.mouse.up()
    wire_between(page, source, target).wait_for(state="attached")
    told(page, f"{source} -> {target}")  # the server knows it, and what it changed was sent


def whole_canvas(page):
    """Fit the view until all blocks are seen and none moves: a layout may be on its way."""
    for _ in range(10):
        page.get_by_label("Fit View").click()
        if page.get_by_test_id("rf__wrapper").evaluate(ALL_SEEN):
            return
    pytest.fail("blocks stay outside the view")


ALL_SEEN = """async (canvas) => {
    const rectangle = (it) => it.getBoundingClientRect();
    const seen = () => [...canvas.querySelectorAll(".react-flow__node")].map(rectangle);
    const frame = () => new Promise(requestAnimationFrame);
    const still = 10;
    for (let last = "", n = 0; n < still; n++) {
        const now = JSON.stringify(seen());
        if (now !== last) [last, n] = [now, 0];
        await frame();
    }
    const all = rectangle(canvas);
    return seen().every((r) => r.left >= all.left && r.right <= all.right
        && r.top >= all.top && r.bottom <= all.bottom);
}"""


def save(page, name):
    fill(page, "File", name)
    page.get_by_role("button", name=re.compile("^Saved?$")).click()
    told(page, f"wrote {name}")


def accessible(page):
    """Let axe look at what is shown."""
    if not AXE.exists():
        pytest.skip("axe-core is not installed: npm install --no-save --prefix .ci axe-core")
    page.wait_for_function("Bokeh.documents[0].is_idle")
    page.evaluate(AXE.read_text("utf-8"))
    found = page.evaluate("axe.run(document, {resultTypes: ['violations', 'passes']})")
    bad = [
        (rule["id"], node["html"])
        for rule in found["violations"]
        if rule["impact"] in ("serious", "critical")
        for node in rule["nodes"]
    ]
    assert bad == [], bad
    assert "color-contrast" in {rule["id"] for rule in found["passes"]}
