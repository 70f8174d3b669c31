"""Outlines to scale, read back by ezdxf and by an XML parser."""

import math
import xml.etree.ElementTree as ET

import pytest

import blockmech as bm
from tests.gallery import mechanism


def test_a_dxf_has_links_as_closed_outlines_with_holes(tmp_path):
    ezdxf = pytest.importorskip("ezdxf", reason="the outside reader of DXF")
    mech = mechanism("ruiz_fourbar")
    (path,) = bm.write(mech, tmp_path / "a.dxf", at=[0.7], width="200mm", hole="50mm")
    document = ezdxf.readfile(path)
    assert document.dxfversion == "AC1009"
    assert not document.audit().errors
    space = document.modelspace()
    crank = list(space.query('*[layer=="CRANK_CRANK"]'))
    holes = [e for e in crank if e.dxftype() == "CIRCLE"]
    a, b = (complex(e.dxf.center.x, e.dxf.center.y) for e in holes)
    assert abs(a - b) == pytest.approx(2000.0, rel=1e-12)  # the crank is 2 m long
    assert {e.dxf.radius for e in holes} == {25.0}
    lines = [e for e in crank if e.dxftype() == "LINE"]
    arcs = [e for e in crank if e.dxftype() == "ARC"]
    assert len(lines) == len(arcs) == 2
    ends = [p for e in lines for p in (e.dxf.start, e.dxf.end)]
    for arc in arcs:  # each arc begins and ends where a line does
        for end in (arc.start_point, arc.end_point):
            assert min((end - p).magnitude for p in ends) < 1e-9
    length = sum((e.dxf.end - e.dxf.start).magnitude for e in lines)
    assert length == pytest.approx(4000.0)


def test_an_svg_is_to_scale(tmp_path):
    (path,) = bm.write(mechanism("watt_sixbar"), tmp_path / "a.svg", at=[1.0])
    root = ET.parse(path).getroot()
    box = [float(x) for x in root.get("viewBox").split()]
    assert root.get("width") == f"{box[2]!r}mm"
    groups = [g.get("id") for g in root.iter("{http://www.w3.org/2000/svg}g") if g.get("id")]
    assert {"frame", "crank.crank"} <= set(groups)
    radii = [float(c.get("r")) for c in root.iter("{http://www.w3.org/2000/svg}circle")]
    assert radii
    assert all(math.isfinite(x) and x > 0 for x in box[2:])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"width": "wide"}, "20mm"),
        ({"width": "5mm", "hole": "6mm"}, "smaller"),
        ({"hole": "-1mm"}, "20mm"),
    ],
)
def test_widths_that_cannot_be(options, message, tmp_path):
    with pytest.raises(bm.RequestError, match=message):
        bm.write(mechanism("ruiz_fourbar"), tmp_path / "a.dxf", at=[0.7], **options)
    assert not list(tmp_path.iterdir())


def test_ezdxf_knows_that_outlines_are_millimetres(tmp_path):
    ezdxf = pytest.importorskip("ezdxf", reason="the tool that reads it")
    (path,) = bm.write(bm.Graph.load("graphs/ruiz_fourbar.json"), tmp_path / "a.dxf", at=[0.7])
    drawing = ezdxf.readfile(path)
    assert drawing.units == ezdxf.units.MM
    assert len(list(drawing.modelspace().query("CIRCLE"))) >= 8


def test_outlines_of_a_drawing_come_back_with_its_links(tmp_path):
    linkage = bm.read("graphs/joints/ruiz_fourbar.json")
    (path,) = bm.write(linkage, tmp_path / "a.dxf", at=[0.7])
    again = bm.read(path)  # R12 has names in capitals
    assert {link.lower() for link in again.links} == set(linkage.links) - {"frame"}
    (path,) = bm.write(linkage, tmp_path / "address", "address", at=[0.7])
    text = path.read_text("utf-8")
    assert all(f",{link}," in text for link in set(linkage.links) - {"frame"})


def test_an_address_of_pmks_comes_back_with_its_joints(tmp_path):
    linkage = bm.read("graphs/joints/slider_crank.json")
    (path,) = bm.write(linkage, tmp_path / "a.pmks", at=[0.7])
    assert set(linkage.joints) <= set(bm.read(path).joints)


@pytest.mark.parametrize("suffix", [".svg", ".dxf"])
def test_links_without_pins_have_no_outlines(suffix, tmp_path):
    with pytest.raises(bm.RequestError, match="no link has a pin to go around"):
        bm.write(mechanism("motions/sticking_slider"), tmp_path / f"a{suffix}", at=[0.0])
