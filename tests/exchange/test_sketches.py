"""Sketches of DXF and SVG: what was written comes back, slots, drives, transforms, nonsense."""

import math

import numpy as np
import pytest

import blockmech as bm
from blockmech.ground.errors import FormatError
from tests.gallery import mechanism


@pytest.mark.parametrize("suffix", ["dxf", "svg"])
@pytest.mark.parametrize("name", ["watt_sixbar", "ruiz_fourbar", "stephenson_3_triad"])
def test_outlines_come_back_as_the_same_links(name, suffix, tmp_path):
    mech = mechanism(name)
    (path,) = bm.write(mech, tmp_path / f"a.{suffix}", at=[1.0])
    text = path.read_text("utf-8")
    drive = mech.run(at=[1.0], want="*.p")
    pin = mech.structure.feeds[mech.structure.driven[mech.drivers[0]]]
    crank = complex(drive[f"{pin}.p"][0]) * 1e3
    if suffix == "dxf":  # somebody marks the driven pin
        mark = f"0\nCIRCLE\n8\nDRIVE\n10\n{crank.real!r}\n20\n{crank.imag!r}\n40\n1.0\n"
        text = text.replace("0\nENDSEC\n0\nEOF", f"{mark}0\nENDSEC\n0\nEOF")
    else:
        circle = f'<circle cx="{crank.real!r}" cy="{-crank.imag!r}" r="1"/>'
        text = text.replace("</svg>", f'<g id="drive">{circle}</g></svg>')
    path.write_text(text, "utf-8")
    linkage = bm.read(path, unit="mm")
    assert not linkage.check()
    assert len(linkage.links) == len(mech.structure.links) - 1
    angles = np.linspace(0.0, 0.3, 5)
    ours = mech.run(at=1.0 + angles, want="*.p")
    theirs = linkage.run(at=angles, want="joint.*.p")
    size = max(abs(theirs[c]).max() for c in theirs)
    for column in theirs:
        distance = min(np.abs(ours[c] - theirs[column]).max() for c in ours)
        assert distance < 1e-9 * size, column


SVG = """<svg width="100mm" height="50mm" viewBox="0 0 200 100" xmlns:inkscape="i">
<g transform="translate(10, 5) rotate(90)"><g inkscape:label="ground">
<circle cx="0" cy="0" r="2"/></g>
<g inkscape:label="crank" transform="matrix(1 0 0 1 0 0)"><circle cx="0" cy="0" r="1"/>
<ellipse cx="0" cy="-10" rx="1" ry="1"/></g>
<g inkscape:label="rod" transform="scale(2)"><circle cx="0" cy="-5" r="1"/>
<circle cx="0" cy="-25" r="1"/><rect width="3" height="4"/></g>
<g inkscape:label="slot"><line x1="0" y1="-30" x2="0" y2="-80"/></g>
<g id="motor"><circle cx="0" cy="0" r="3"/></g></g></svg>"""


def test_a_slider_crank_of_a_drawing_program(tmp_path):
    (tmp_path / "a.svg").write_text(SVG, "utf-8")
    linkage = bm.read(tmp_path / "a.svg")  # 200 units are 100 mm; rotated, -y is along x
    assert not linkage.check()
    run = linkage.run(at=[0.0, 1.0], want=["joint.*.p"])
    (pin,) = (c for c in run if "p" in c and abs(run[c][0] - (0.030 - 0.0025j)) < 1e-9)
    x = 0.005 * math.cos(1.0) + math.sqrt(0.02**2 - (0.005 * math.sin(1.0)) ** 2)
    assert run[pin][1] == pytest.approx(0.005 + x - 0.0025j, abs=1e-12)


def test_a_slot_in_a_link_and_units_of_dxf(tmp_path):
    def entity(kind, layer, *numbers):
        codes = (10, 20, 11, 21) if kind == "LINE" else (10, 20, 40)
        rows = "".join(f"{c}\n{x}\n" for c, x in zip(codes, numbers, strict=True))
        return f"0\n{kind}\n8\n{layer}\n{rows}"

    text = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n1\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n"
    text += entity("CIRCLE", "FRAME", 0, 0, 1) + entity("CIRCLE", "FRAME", 0, -5, 1)
    text += entity("CIRCLE", "CRANK", 0, 0, 1) + entity("CIRCLE", "CRANK", 2, 0, 1)
    text += entity("CIRCLE", "LEVER", 0, -5, 1) + entity("CIRCLE", "LEVER", 4, 5, 1)
    text += entity("LINE", "SLOT LEVER", 0, -5, 4, 5) + entity("CIRCLE", "DRIVE", 0, 0, 1)
    text += entity("LINE", "CRANK", 0, 0, 2, 0) + entity("CIRCLE", "NOTES", 9, 9, 1)
    (tmp_path / "w.dxf").write_text(text + "0\nENDSEC\n0\nEOF\n", "utf-8")
    linkage = bm.read(tmp_path / "w.dxf")
    assert not linkage.check()
    assert "layer NOTES has one pin: left out" in linkage.extras["notes"]
    run = linkage.run(at=[0.0, 0.7], want="link.LEVER.angle")
    tip = 2 * np.exp(0.7j)
    turned = np.angle(tip + 5j) - np.angle(2 + 5j)
    assert run["link.LEVER.angle"][1] == pytest.approx(turned, abs=1e-12)
    assert linkage.to_data()["joints"]["A"]["at"][0] == [0.0, 0.0]
    assert (
        max(abs(x) for j in linkage.to_data()["joints"].values() for x in j["at"][0]) == 5 * 0.0254
    )


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.svg", "<svg><g id='a'><rect/></g></svg>", "no circle"),
        ("a.svg", SVG.replace("scale(2)", "skewX(2)"), "transform"),
        ("a.svg", SVG.replace('cy="-10"', 'cy="1e999"'), "not a number"),
        ("a.svg", SVG.replace('x2="0" y2="-80"', 'x2="0" y2="-30"'), "at one place"),
        ("a.svg", "<!DOCTYPE svg [<!ENTITY a 'b'>]>" + SVG, "entities"),
        ("a.svg", "<svg><g id='a'>" + "<circle/>" * 1001 + "</g></svg>", "1001 circles"),
        ("a.dxf", "0\nSECTION\n2\nENTITIES\n0\nCIRCLE\n8\nA\n10\nx\n20\n0\n0\nEOF\n", "number"),
        ("a.dxf", "0\nSECTION\nhello\nworld\n", "no group code"),
        ("a.dxf", "0\nSECTION\n2\nENTITIES\n0\nENDSEC\n", "no circle"),
    ],
)
def test_sketches_that_cannot_be_read(name, text, message, tmp_path):
    (tmp_path / name).write_text(text, "utf-8")
    with pytest.raises(FormatError, match=message) as error:
        bm.read(tmp_path / name)
    assert len(error.value.problems) == 1
