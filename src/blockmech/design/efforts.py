"""Equivalent efforts: the moment or force at another place than the driver.

What stands for the drive is a load like any other: it is added with size 0, and its size is the
unknown of the same inverse question.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from blockmech.compiled import Compiled
from blockmech.ground.names import free_name
from blockmech.loads import Couple, Force, Motor
from blockmech.model.graph import Graph
from blockmech.model.joints.linkage import Linkage
from blockmech.model.structure import JointRef, Structure
from blockmech.typing import Record

EFFORT = re.compile(r"(?P<point>.+)\.(?P<kind>moment|force)(?P<axis>\.[xy])?")
NOTHING = {"kind": "constant", "value": 0.0}
SIZES = {"moment": "moment", "vector": "force"}  # kind of an effort -> the parameter of its size


def with_efforts(
    mechanism: Compiled, names: Iterable[str], parameters: Record
) -> tuple[Compiled, dict[str, str]]:
    """The mechanism with loads of size 0 for those names that are efforts, not parameters.

    Parameters
    ----------
    names : parameter paths or efforts. Of links and joints ``"joint.C.moment"`` between the links
        of a pin, ``"joint.S.force"`` along a guide, ``"link.rod.moment"``,
        ``"link.rod.P.force.x"`` at a marker in ground axes; of blocks ``"dyad.C.moment"``,
        ``"dyad.j.moment"``, ``"dyad.P.force.x"``
    parameters : of the mechanism, by path

    Returns
    -------
    The mechanism itself without efforts, and name -> parameter path in it. Names that are neither
    are left as they are.
    """
    paths = {name: name for name in names}
    document: Any = mechanism.document
    structure = mechanism.structure
    efforts = {name: EFFORT.fullmatch(name) for name in paths if name not in parameters}
    if document is None or not any(efforts.values()):
        return mechanism, paths
    document = document.snapshot() if isinstance(document, Linkage) else document.flat().snapshot()
    taken = {*structure.blocks, *structure.elements, *getattr(document, "loads", ())}
    section = "loads." if isinstance(document, Linkage) else ""
    loads: dict[str, str] = {}  # point and kind -> parameter path of the size
    for name, match in efforts.items():
        if match is None:
            continue
        point, axis, kind = match["point"], match["axis"] or "", match["kind"]
        key = f"{point}.{kind}"
        if key not in loads:
            effort = free_name("effort", taken)
            taken.add(effort)
            add = _add_to_linkage if isinstance(document, Linkage) else _add_to_graph
            number = add(document, structure, effort, point, kind if axis == "" else "vector")
            if not number:
                continue
            loads[key] = f"{section}{effort}.{number}"
        paths[name] = loads[key] + axis
    return document.compile(), paths


def _add_to_linkage(document: Linkage, _: Structure, effort: str, point: str, kind: str) -> str:
    """Add a load of size 0 at a joint, link or marker; the parameter of its size, "" for none."""
    section, *rest = point.split(".", 2)
    owner = rest[0] if rest else ""
    if section == "joint" and owner in document.joints and kind != "vector":
        document.add_load(effort, "motor", joint=owner, law=NOTHING)
        return "law.value"
    marker = rest[1] if len(rest) > 1 else ""
    link = document.links.get(owner) if section == "link" else None
    if link is None or (marker and marker not in link.markers):
        return ""
    if kind == "moment":
        document.add_load(effort, "couple", link=owner, moment=0.0)
    if kind == "vector":
        at = link.markers[marker].at if marker else (0.0, 0.0)
        document.add_load(effort, "force", link=owner, at=at, force=(0.0, 0.0))
    return SIZES.get(kind, "")


def _add_to_graph(document: Graph, structure: Structure, effort: str, point: str, kind: str) -> str:
    """The same in a block diagram, but for forces along guides."""
    name, _, port = point.rpartition(".")
    block = structure.blocks.get(name)
    if block is None:
        return ""
    if kind == "moment" and port in block.joints:
        ref = JointRef(name, port)
        support = structure.feeds[ref] if ref in structure.feeds else structure.earlier_link(ref)
        document.add(effort, Motor(law=NOTHING))
        document.connect(str(support), f"{effort}.a")
        document.connect(str(structure.later_link(ref)), f"{effort}.b")
        return "law.value"
    if kind == "moment" and port in block.link_names:
        document.add(effort, Couple(moment=0.0))
        document.connect(point, f"{effort}.on")
        return SIZES[kind]
    if kind == "vector" and port in block.all_markers:
        document.add(effort, Force(force=(0.0, 0.0)))
        document.connect(point, f"{effort}.at")
        return SIZES[kind]
    return ""
