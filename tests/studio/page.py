"""A page in a browser, and what a hand does there: acts are counted, places are asked for."""

import json
import re
from pathlib import Path

from blockmech.editor.sheets import unpacked

FRAMES = """() => {
    window.spent = [];
    const ask = window.requestAnimationFrame;
    window.requestAnimationFrame = (act) => ask((time) => {
        const begun = performance.now();
        act(time);
        window.spent.push(performance.now() - begun);
    });
}"""  # keeps how long each frame took [ms] from then on


class Sheet:
    """A sheet in the window, shown once its ``sign`` is there.

    ``acts`` counts clicks, drags, presses and typed words.
    """

    def __init__(self, page, studio, source, sign="html[data-ready]"):
        self.page, self.acts = page, 0
        self.root = re.match(r"http://[^/]*", studio[0])[0]
        if not page.context.cookies():
            page.goto(studio[0])
        reply = page.request.post(f"{self.root}/api/documents", data=json.dumps(source))
        assert reply.ok, reply.text()
        self.id = reply.json()["id"]
        page.goto(f"{self.root}/?sheet={self.id}")
        page.locator(sign).first.wait_for(state="attached")
        self.svg = page.locator(".canvas svg").first

    @classmethod
    def of(cls, page, sheet):
        """The same sheet in another window."""
        window = cls.__new__(cls)
        page.locator("html[data-revision]").wait_for(state="attached")
        window.page, window.acts, window.root, window.id = page, 0, sheet.root, sheet.id
        window.svg = page.locator(".canvas svg").first
        return window

    @property
    def state(self):
        return self.page.request.get(f"{self.root}/api/documents/{self.id}").json()

    def places(self):
        """Where each pin is drawn, as the server has it [m]."""
        positions = {}
        drawing = self.state["drawing"]
        for pin in drawing["pins"]:
            link, x, y = pin["at"]
            ox, oy, angle = drawing["poses"][link]
            z = complex(ox, oy) + complex(x, y) * _turn(angle)
            positions[pin["name"]] = z
        return positions

    def changed(self, act):
        """Do something, and wait until the sheet that comes back is drawn."""
        html, page = self.page.locator("html"), self.page
        before = html.get_attribute("data-revision")
        act()
        try:
            page.locator(f'html:not([data-revision="{before}"])').wait_for(state="attached")
        except Exception as error:
            raise AssertionError(f"nothing changed; it says {self.said()}") from error

    def said(self):
        parts = (self.page.locator(".left > .status"), self.page.locator(".left > .wrong"))
        return " ".join(part.inner_text() for part in parts if part.is_visible())

    def at(self, x, y):
        box = box_of(self.svg)
        return box["x"] + x * box["width"], box["y"] + y * box["height"]

    def to(self, x, y):
        """Pixels of a place [m]."""
        scale, across, top = map(float, self.svg.get_attribute("data-view").split())
        box = box_of(self.svg)
        return box["x"] + across + x * scale, box["y"] + top - y * scale

    def pin(self, name):
        return self.middle(f'.pin[data-pin="{name}"] .ring')

    def middle(self, selector):
        box = box_of(self.page.locator(selector))
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag(self, a, b, typed="", steps=5):
        self.acts += 1 + bool(typed)
        mouse = self.page.mouse
        mouse.move(*a)
        mouse.down()
        mouse.move(*b, steps=steps)
        if typed:
            self.page.keyboard.type(typed)
            self.page.keyboard.press("Enter")
        mouse.up()

    def hold(self, name, right, up, steps):
        """Take hold of a pin and move it [px], live; whoever calls lets go."""
        x, y = self.pin(name)
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(x + right, y - up, steps=steps)
        self.page.locator('svg[data-live="exact"]').first.wait_for(state="attached")
        self.page.wait_for_timeout(200)

    def form(self):
        """The document, as plain data."""
        reply = self.page.request.post(f"{self.root}/api/documents/{self.id}/link", data="{}")
        return unpacked(reply.json()["link"]).to_data()

    def take(self, tool, *names):
        """Press a tool that goes on with the pins that are clicked, and end it."""
        self.tool(tool)
        for name in names:
            self.acts += 1
            self.changed(lambda name=name: self.page.mouse.click(*self.pin(name)))
        self.page.keyboard.press("Escape")

    def link(self, a, b, typed=""):
        self.changed(lambda: self.drag(a, b, typed))

    def click(self, name, more=False):
        self.acts += 1
        if more:
            self.page.keyboard.down("Control")
        self.page.mouse.click(*self.pin(name))
        if more:
            self.page.keyboard.up("Control")
        self.page.locator(f'.pin.chosen[data-pin="{name}"]').wait_for(state="attached")

    def press(self, name):
        """Press a tool that changes the sheet."""
        self.changed(lambda: self.tool(name))

    def tool(self, name):
        self.acts += 1
        self.page.get_by_role("button", name=name, exact=True).first.click()

    def field(self, label):
        return self.page.get_by_label(label, exact=True)


def box_of(element):
    """The box of an element on the screen [px]; there is none while the page redraws."""
    box = None
    while box is None:
        element.wait_for(state="attached")
        box = element.bounding_box()
    return box


def _turn(angle):
    import cmath

    return cmath.rect(1.0, angle)


def heap_around(page, studio, edits):
    """The page's memory [bytes] before and after a pin of a four-bar is moved to and fro."""
    hand = Sheet(page, studio, {"example": "joints/ruiz_fourbar"})
    session = page.context.new_cdp_session(page)

    def heap():
        session.send("HeapProfiler.collectGarbage")
        return session.send("Runtime.getHeapUsage")["usedSize"]

    hand.click("B")
    hand.changed(lambda: page.keyboard.press("ArrowRight"))
    before = heap()
    for k in range(edits):
        hand.changed(lambda k=k: page.keyboard.press("ArrowLeft" if k % 2 else "ArrowRight"))
    return before, heap()


def resident(process):
    """Memory of a process [MB], by its number; of Linux."""
    status = Path(f"/proc/{process}/status").read_text("ascii").splitlines()
    (line,) = (line for line in status if line.startswith("VmRSS"))
    return int(line.split()[1]) * 1024 / 1e6
