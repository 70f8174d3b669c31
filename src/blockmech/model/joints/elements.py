"""Loads of a document as elements of the graph, and what a law's argument becomes there.

What is given in a link's frame is turned into that of its block. Loads of a sliding joint become
thrusts along its guide.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

from blockmech.ground.values import xy
from blockmech.model.form import plain
from blockmech.model.joints.contents import FRAME, HOLDS
from blockmech.model.joints.layout import Connection, Connections, LinkPlacement
from blockmech.model.joints.varied import phase, remainder
from blockmech.typing import Arguments, Data, Record

Hold: TypeAlias = tuple[str, str, complex | None]
"""A terminal of an element, and the link and place that it takes hold of; None: the link."""

BlockDraft: TypeAlias = tuple[str, Data, Sequence[Hold]]
"""An element of the graph: its name, data and holds."""


def links_read_as_they_are(loads: Record, pairs: Connections) -> set[str]:
    """Links whose frames a law of their relative angle reads.

    The angle is one between -pi and pi, so a law of it cannot be moved to other frames.
    """
    links: set[str] = set()
    for load in loads.values():
        kinds = [t.kind for t in load.terminals.values()]
        law = getattr(load, "law", None)
        if law is None or kinds != ["link", "link"] or load.driver is not None:
            continue
        joint = pairs.get(load.joint or "")
        if "coordinate" in law.variables() and (joint is None or joint.kind == "R"):
            links.update(load.links or joint.ends if joint else load.links)
    return links - {FRAME}


def links_sensed(linkage: Any) -> set[str]:
    """Links whose angle a signal reads, for the same reason."""
    parts = (wire.source.split(".") for wire in linkage.wires)
    return {p[1] for p in parts if p[0] == "link" and p[2:] == ["angle"]} & {*linkage.links}


def elements(
    name: str, load: Any, pairs: Connections, seats: Mapping[str, LinkPlacement]
) -> Iterator[BlockDraft]:
    """The element that a load becomes; two of them for a damped spring along a guide."""
    terminals = load.terminals
    data = {key: value for key, value in plain(load).items() if key not in HOLDS}
    joint = getattr(load, "joint", None)
    if joint is not None and pairs[joint].kind == "P":
        yield from _along_guide(name, load, data, pairs[joint], seats)
        return
    links = list(pairs[joint].ends) if joint else getattr(load, "links", None) or [load.link]
    at = getattr(load, "at", None)
    places = [p.z for p in at] if isinstance(at, list) else [at.z if at else 0j]
    for key in {*data}.intersection(load.link_vectors):
        data[key] = _turned(getattr(load, key).z, seats[links[0]])
    if "rest_angle" in type(load).model_fields:
        turn = phase(seats[links[1]].e) - phase(seats[links[0]].e)
        if turn:
            data["rest_angle"] = remainder(load.rest_angle + turn, math.tau)
    holds = [
        (terminal, link, places[k] if kind.kind == "point" else None)
        for k, ((terminal, kind), link) in enumerate(zip(terminals.items(), links, strict=True))
    ]
    yield name, {"type": load.type_name, **data}, holds


def _along_guide(
    name: str, load: Any, data: Data, c: Connection, seats: Mapping[str, LinkPlacement]
) -> Iterator[BlockDraft]:
    """A load between the links of a P joint is a force along its guide, of their coordinate."""
    holds: list[Hold] = [("a", c.first, c.at[0]), ("b", c.second, c.at[1])]
    along = _turned(c.along[0], seats[c.first])
    useful = {"useful": data["useful"]} if "useful" in data else {}

    def thrust(law: Data, more: Arguments) -> Data:
        return {"type": "load.thrust", "law": law, **more, "direction": along, **useful}

    if "law" in data:
        driver = {"driver": data["driver"]} if "driver" in data else {}
        yield name, thrust(data["law"], driver), holds
        return
    k, c_d = load.stiffness, load.damping
    rest = load.rest_angle if "rest_angle" in type(load).model_fields else load.free_length
    if k or not c_d:
        law = {"kind": "polynomial", "of": "coordinate", "coefficients": [k * rest, -k]}
        yield name, thrust(law, {}), holds
    if c_d:
        law = {"kind": "polynomial", "of": "rate", "coefficients": [0.0, -c_d]}
        yield f"{name}_damping" if k else name, thrust(law, {}), holds


def _turned(vector: complex, seat: LinkPlacement) -> list[float]:
    return xy(seat.direction(vector))
