"""Outputs of a joint-based document: its own links, joints and drivers, whatever the blocks.

Every output here is one of the graph's (`blockmech.outputs`), read with the sign, the frame
and the name of the document. Nothing is computed anew.

Signs. The graph reports a pair's reaction, friction and slip on its later link; a document
wants them on the joint's second link. Where the second is the earlier one (``flipped``), all
change sign: force and couple by action and reaction (C about the same slider's point), rates
because they are seen from the other link. What is measured along or across a guide (N along
n = i u, friction and slip along u) changes once more where the graph's guide points against
the document's (``turned``). Power never changes.

A pin of more than two links is one pair for each further link, named after it:
``joint.A.rod.reaction`` is the force of the first link of A on ``rod``. Where the graph seats
the pin on another link, the forces of several pairs add up to it.
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from blockmech.model.naming import JointName, LinkName, Names
from blockmech.model.structure import LinkRef, Structure
from blockmech.outputs import Output, Reader

Known = Mapping[str, Output]

TURN = 2 * math.pi
OF_LINKS = ("angle", "omega", "alpha")
OF_POINTS = ("p", "v", "a")
OF_JOINTS = ("reaction", "N", "C", "friction", "slip", "friction_power")
OF_DRIVERS = (
    *("q", "rate", "acceleration", "drive", "drive_by_reduction"),
    *("power", "J_red", "tau_red", "dJ_red"),
)


def outputs_by_link(structure: Structure, names: Names, known: Known) -> Iterator[Output]:
    """Every output of a joint-based document, in its own order.

    Parameters
    ----------
    structure : of the graph that was made of the document
    names : where links, joints and drivers of the document are in the graph
    known : the graph's outputs by name
    """
    said = {str(name.link): link for link, name in names.links.items()}
    said[str(structure.frame_link)] = "frame"
    for found in _renamed(structure, names, known):
        yield found._replace(by=said.get(found.by, found.by), on=said.get(found.on, found.on))


def _renamed(structure: Structure, names: Names, known: Known) -> Iterator[Output]:
    pairs = {pair.joint: pair for pair in names.joints.values()}
    for driver, driven in structure.driven.items():
        yield from _driver(driver, pairs.get(driven), known)
    for link, place in names.links.items():
        yield from _link(link, place, structure.frame_link, known)
    for joint, pair in names.joints.items():
        yield from _joint(joint, pair, structure, names, known)
    yield from _loads(structure, names, known)
    yield from (known[n] for n in known if n.startswith("mechanism."))


def _driver(name: str, pair: JointName | None, known: Known) -> Iterator[Output]:
    for what in OF_DRIVERS:
        found = known.get(f"{name}.{what}")
        if found is None:
            continue
        if found.by and pair is not None:
            found = _between(found, pair)
        yield found._replace(name=f"driver.{name}.{what}")


def _link(name: str, where: LinkName, frame: LinkRef, known: Known) -> Iterator[Output]:
    """Motion of a link's own frame, and of its markers; of the fixed link its markers only."""
    if where.link != frame:
        origin = {what: known[f"{where.marker}.{what}"] for what in OF_POINTS}
        turning = {what: known[f"{where.link}.{what}"] for what in OF_LINKS}
        turning["angle"] = _rotated(turning["angle"], where.turn)
        for point, turn in zip(OF_POINTS, OF_LINKS, strict=True):
            yield origin[point]._replace(name=f"link.{name}.{point}")
            yield turning[turn]._replace(name=f"link.{name}.{turn}")
    for marker, ref in where.markers.items():
        for what in OF_POINTS:
            yield known[f"{ref}.{what}"]._replace(name=f"link.{name}.{marker}.{what}")


def _joint(
    name: str, where: JointName, structure: Structure, names: Names, known: Known
) -> Iterator[Output]:
    guided = structure.joint(where.joint).kind == "P"
    for what in OF_JOINTS:
        found = known.get(f"{where.joint}.{what}")
        if found is None:
            continue
        if what == "reaction":
            found = _sum_of(found, where, known)
        elif what == "slip" and _seated_elsewhere(where, structure, names):
            found = _difference(found, where, names, known)
        elif what != "friction_power":
            along = guided and what != "C"
            found = _turned(found, where.flipped ^ (along and where.turned))
        if found.by:
            found = _between(found, where)
        yield found._replace(name=f"joint.{name}.{what}")


def _between(output: Output, where: JointName) -> Output:
    """What the first link of a joint does to its second."""
    if any(where.links):
        by, on = where.links
    else:
        by, on = (output.on, output.by) if where.flipped else (output.by, output.on)
    return output._replace(by=by, on=on)


def _sum_of(reaction: Output, where: JointName, known: Known) -> Output:
    """The force that several pairs of one pin add up to."""
    pairs = [(where.joint, where.flipped), *where.others]
    parts = [_turned(known[f"{ref}.reaction"], flipped) for ref, flipped in pairs]
    return parts[0] if len(parts) == 1 else _total(reaction, parts)


def _total(output: Output, parts: list[Output]) -> Output:
    """The sum of outputs of one value each, declared like ``output``."""

    def total(*columns: Any) -> Any:
        each = (part.read(x) for part, x in zip(parts, columns, strict=True))
        return functools.reduce(operator.add, each)

    return output._replace(ask=lambda s: [v for p in parts for v in p.ask(s)], read=total)


def _seated_elsewhere(where: JointName, structure: Structure, names: Names) -> bool:
    """Whether a pair of a pin joins other links in the graph than in the document."""
    if not any(where.links):
        return False
    mine = {names.links[n].link if n in names.links else structure.frame_link for n in where.links}
    return mine != {structure.earlier_link(where.joint), structure.later_link(where.joint)}


def _difference(slip: Output, where: JointName, names: Names, known: Known) -> Output:
    """The rate of the second link less that of the first; the fixed link has none."""
    signs, rates = [], []
    for sign, link in zip((-1.0, 1.0), where.links, strict=True):
        if link in names.links and (rate := known.get(f"{names.links[link].link}.omega")):
            signs.append(sign)
            rates.append(rate)

    return _total(slip, [_turned(r, sign < 0) for sign, r in zip(signs, rates, strict=True)])


def _loads(structure: Structure, names: Names, known: Known) -> Iterator[Output]:
    """What loads give at their terminals, and their power, under the document's names."""
    outputs: dict[str, dict[str, Output]] = {}
    for name, output in known.items():
        element, _, what = name.partition(".")
        if element in structure.elements:
            outputs.setdefault(element, {})[what] = output
    for load, elements in (names.loads or {e: (e,) for e in structure.elements}).items():
        for what, first in outputs[elements[0]].items():
            parts = [outputs[element][what] for element in elements]
            found = first if len(parts) == 1 else _total(first, parts)
            yield found._replace(name=f"{load}.{what}", by=found.by and load)


def _read(output: Output, more: Callable[[Any], Any]) -> Output:
    """The same output, read and then changed."""
    read: Reader = output.read
    return output._replace(read=lambda *values: more(read(*values)))


def _turned(output: Output, flipped: bool) -> Output:
    if not flipped:
        return output
    return _read(output, lambda x: -x if output.kind == "vector" else 0.0 - x)  # no -0


def _rotated(angle: Output, turn: float) -> Output:
    """The angle [rad] of a frame that stands at ``turn`` in the link's, between -pi and pi."""
    if turn == 0.0:
        return angle

    def within_a_turn(theta: Any) -> Any:
        return theta - TURN * np.round(theta / TURN)

    return _read(angle, lambda theta: within_a_turn(theta + turn))


def blocks_by_link(names: Names) -> dict[str, str]:
    """Block -> itself and the document's links in it, e.g. ``"g1 (rod, piston)"``."""
    found: dict[str, list[str]] = {}
    for link, where in names.links.items():
        found.setdefault(where.link.block, []).append(link)
    return {
        block: f"{block} ({', '.join(links)})" if links != [block] else block
        for block, links in found.items()
    }


def joints_by_name(names: Names) -> dict[str, str]:
    """Joint of the graph -> ``"joint.<name>"`` of the document."""
    return {str(where.joint): f"joint.{name}" for name, where in names.joints.items()}
