"""What the page works out itself is what Python says: poses, and numbers that follow a drag."""

import json
import random
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import blockmech as bm
from blockmech import editor
from blockmech.builders import opened
from blockmech.editor import drawing, sketching
from blockmech.editor.dragging import Hold, dragged
from blockmech.editor.live import live
from blockmech.editor.pins import guide_of, pins_of
from blockmech.editor.revision import Revision
from blockmech.editor.turn import poses_of
from blockmech.testing.graph_files import gallery

NODE = shutil.which("node")
WEB = Path(editor.__file__).parent / "web"
JOINTS = [name for name in gallery() if name.startswith("joints/")]
ON_THE_SERVER = {  # whose groups have no closed form and a driver inside
    "joints/floating_drive_press",
    "joints/scissor_lift",
}
REFUSED = {"joints/planetary_hoist"}  # whose wheels mesh where they stand alone
EVERY = 60  # of the samples

pytestmark = pytest.mark.skipif(NODE is None, reason="there is no Node")

SCRIPT = """
import { readFileSync } from "node:fs";
import { Live } from "%s/lib/live.js";
const { kernel, data, rows, places } = JSON.parse(readFileSync(process.argv[2], "utf-8"));
const made = new Live(await import(kernel), data);
if (places) made.move(places);
console.log(JSON.stringify(rows.map((q) => made.poses(q))));
"""


def in_the_page(folder, functions, rows, positions=None):
    """Poses of links [x, y, cos, sin] at rows of coordinates, worked out by Node."""
    kernel, script, inputs = (folder / name for name in ("k.mjs", "run.mjs", "given.json"))
    kernel.write_text(functions.text, encoding="utf-8")
    script.write_text(SCRIPT % WEB.as_posix(), encoding="utf-8")
    query = {
        "kernel": kernel.as_uri(),
        "data": functions.data(),
        "rows": rows,
        "places": positions,
    }
    inputs.write_text(json.dumps(query), encoding="utf-8")
    process = subprocess.run([NODE, script, inputs], capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)


def rows_of(motion):
    """Coordinates at some samples, in which all links stand."""
    some = [k for k in range(0, len(motion.samples), EVERY) if motion.feasible[k]]
    return some, [{d: float(q[k]) for d, q in motion.q.items()} for k in some]


def compare(poses, motion, some, size):
    expected = poses_of(motion)
    for row, k in zip(poses, some, strict=True):
        for link, (x, y, angle) in expected.items():
            pose = np.array([x[k], y[k], np.cos(angle[k]), np.sin(angle[k])])
            scale = np.array([size, size, 1.0, 1.0])
            assert np.abs((np.array(row[link]) - pose) / scale).max() < 1e-12, (link, k)


def now_of(document):
    return Revision(1, document.to_data(), document)


def motion_of(document):
    motion, _ = now_of(document).shown_motion()
    return motion


def size_of(motion):
    return max(float(np.nanmax(np.abs(z))) for z in motion.origin.values())


@pytest.mark.parametrize("name", ["excavator", "watt_sixbar", "valve_engine", "stephenson_3_triad"])
def test_poses_of_blocks_are_those_of_a_run(name, tmp_path):
    document = opened(gallery()[name])
    mechanism = document.compile()
    motion = motion_of(document)
    some, rows = rows_of(motion)
    poses = in_the_page(tmp_path, live(now_of(document), mechanism), rows)
    compare(poses, motion, some, size_of(motion))


@pytest.mark.parametrize("name", [name for name in JOINTS if name not in ON_THE_SERVER | REFUSED])
def test_what_is_seen_while_all_pins_are_dragged_is_what_is_committed(name, tmp_path):
    """All pins a little elsewhere: numbers as the page has them, and a document compiled."""
    document = opened(gallery()[name])
    functions = live(now_of(document), document.compile())
    form = document.to_data()
    pins = pins_of(form)
    size = max(abs(a.z - b.z) for a in pins.values() for b in pins.values())
    shake, to = random.Random(name), {}
    for pin, i in functions.pins.items():
        shared = next((to[p] for p, k in functions.pins.items() if k == i and p in to), None)
        off = 0.004 * size * complex(shake.uniform(-1, 1), shake.uniform(-1, 1))
        to[pin] = shared if shared is not None else pins[pin].z + off
    assert functions.pins.keys() == pins.keys()
    moved = bm.Linkage.from_data(sketching.moved(form, to))
    motion = motion_of(moved)
    some, rows = rows_of(motion)
    positions = {pin: [z.real, z.imag] for pin, z in to.items()}
    poses = in_the_page(tmp_path, functions, rows, positions)
    compare(poses, motion, some, size_of(motion))


@pytest.mark.parametrize("name", sorted(ON_THE_SERVER))
def test_what_the_page_cannot_follow_it_says(name):
    document = opened(gallery()[name])
    functions = live(now_of(document), document.compile())
    assert functions is None or functions.pins == {}


def test_lengths_and_masses_change_no_text():
    document = opened(gallery()["joints/watt_sixbar"])
    form, texts = document.to_data(), set()
    for k in range(1, 6):
        z = pins_of(form)["C"].z + 0.01 * k + 0.007j * k
        moved = bm.Linkage.from_data(sketching.moved(form, {"C": z}))
        texts.add(live(now_of(moved), moved.compile()).data()["hash"])
    assert len(texts) == 1


def test_a_pin_dragged_off_the_axis_of_a_cylinder_turns_its_guide_with_it():
    form = opened(gallery()["joints/excavator"]).to_data()
    moved = sketching.moved(form, {"arm_cylinder_foot": 2.5 + 1.6j})
    assert moved["joints"]["arm_cylinder"] == form["joints"]["arm_cylinder"]
    linkage = bm.Linkage.from_data(moved)
    assert str(linkage.decompose().formation).count("II cylinder") == 3
    assert pins_of(moved)["arm_cylinder"].z == pytest.approx(2.5 + 1.6j, abs=1e-3)
    before, after = (guide_of(f, "arm_cylinder") for f in (form, moved))
    assert after != pytest.approx(before, abs=1e-3)


BLOCKS = [name for name in gallery() if "/" not in name]
ON_THE_SERVER_AS_BLOCKS = {
    *("floating_drive_press", "scissor_lift"),  # as in links and joints
    "n_four_bar",  # a drag may take away its change points
}
HANDLES = 4  # of a file


@pytest.mark.parametrize("name", [n for n in BLOCKS if n not in ON_THE_SERVER_AS_BLOCKS])
def test_what_is_seen_while_a_joint_of_blocks_is_dragged_is_what_is_committed(name, tmp_path):
    """Each joint a little elsewhere: numbers as the page has them, and a document compiled."""
    document = opened(gallery()[name])
    mechanism, now = document.compile(), now_of(document)
    motion = motion_of(document)
    size, shake = size_of(motion), random.Random(name)
    home = {driver: float(q[motion.clearest]) for driver, q in motion.q.items()}
    handles = [pin["name"] for pin in drawing.of_blocks(motion)["pins"] if pin["held"]]
    for handle in handles[:: -(-len(handles) // HANDLES)]:
        hold = Hold.of(mechanism, handle, home)
        new = hold.z + 0.004 * size * complex(shake.uniform(-1, 1), shake.uniform(-1, 1))
        form = dragged(now.form, hold.motion, 0, hold.z, new).form
        if form == now.form:
            continue  # which the act refuses
        functions = live(now, mechanism, (handle, home))
        assert functions.pins == {handle: 0}
        changed = bm.Graph.from_data(form)
        after = motion_of(changed)
        some, rows = rows_of(after)
        poses = in_the_page(tmp_path, functions, rows, {handle: [new.real, new.imag]})
        compare(poses, after, some, size)


@pytest.mark.parametrize("name", sorted(ON_THE_SERVER_AS_BLOCKS))
def test_a_joint_of_blocks_that_the_page_cannot_follow(name):
    document = opened(gallery()[name])
    mechanism = document.compile()
    motion = motion_of(document)
    home = {driver: float(q[motion.clearest]) for driver, q in motion.q.items()}
    pin, *_ = (pin for pin in drawing.of_blocks(motion)["pins"] if pin["held"])
    functions = live(now_of(document), mechanism, (pin["name"], home))
    assert functions is None or functions.pins == {}
