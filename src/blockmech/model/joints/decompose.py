"""From links and joints to blocks: drivers and Assur groups in formation order.

The groups of a mechanism are its own, whatever the order of links and joints in the file; so
is which driver belongs to which group. Only the order of groups that do not wait for each
other is free: a group comes as soon as the links that it waits for are there, of several
drivers first, then by the name of the first link. Frictionless pins of three links and more
are seated on the link that is placed first. Dyads and cylinders become closed-form blocks,
a driven joint on a placed link a driving link, every other group a general one with its home
in the pose of the document, refined.

Names: the block of a driver or a cylinder is named like the driver, a group's after its links.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from typing import Literal, TypeAlias

import numpy as np

from blockmech.assur.formation import Formation, formation
from blockmech.assur.groups import DYADS, Unit, classify
from blockmech.ground.errors import GraphError, Problem, in_file, path_text
from blockmech.ground.plane import EPS
from blockmech.model.joints.closing import Closing, coordinate
from blockmech.model.joints.contents import FRAME, reference_problems
from blockmech.model.joints.diagnosis import (
    dead_centre,
    does_not_close,
    far_off,
    why_not,
    why_stuck,
)
from blockmech.model.joints.diagram import Diagram, Drafts, Sequence
from blockmech.model.joints.dimensioned import dimensioned
from blockmech.model.joints.drafts import closed_form, driving_link, general_group
from blockmech.model.joints.elements import links_read_as_they_are, links_sensed
from blockmech.model.joints.layout import Connections, Layout, Poses, seated
from blockmech.model.joints.linkage import Linkage
from blockmech.model.joints.varied import settled
from blockmech.model.naming import Names
from blockmech.model.parameters import wrong_units
from blockmech.typing import Data

General: TypeAlias = Literal["", "groups", "one"]
Parts: TypeAlias = tuple[Data, Names, Formation, Linkage | None]
"""The fields of a `blockmech.builders.Decomposition`."""


def decompose(linkage: Linkage, general: General = "") -> Parts:
    """Drivers and Assur groups of a document as a graph of blocks.

    Parameters
    ----------
    linkage : the document
    general : "groups" makes every Assur group a general one; "one" makes one general group
        of all links but those that drivers place from the frame on

    Raises `GraphError` with all problems: names that are not there, then why the structure
    cannot work, then joints that do not close.
    """
    try:
        items = linkage.form.items().items()
        foreign = chain.from_iterable(x.foreign(getattr(linkage, key), key) for key, x in items)
        GraphError.raise_for(foreign)
        problems = reference_problems(linkage, vars(linkage))
        GraphError.raise_for([*problems, *wrong_units(linkage.sections())])
        linkage = dimensioned(linkage)
        return _as_blocks(linkage, sequence(linkage), general)
    except GraphError as error:
        raise GraphError(in_file(error.problems, linkage.file)) from None


def sequence(linkage: Linkage) -> Sequence:
    """The formation sequence of a document and its pose, refined. Raises like `decompose`."""
    layout = Layout.of(linkage)
    with np.errstate(over="ignore", under="ignore"):
        measured = np.float64(layout.size) ** 3  # products of lengths are to be numbers
    if not np.finfo(float).tiny < measured < np.inf:
        large = f"the mechanism is {layout.size:.3g} m large"
        problem = Problem("wrong-value", "joints", large, "lengths are in m", "check the places")
        raise GraphError(problem)
    pairs, sums = seated(layout.pairs, layout.drivers)
    groups = formation(layout.links, pairs.values(), (FRAME,), layout.drivers)
    if not groups.complete or not layout.links:
        raise GraphError(why_not(layout, groups.rest))
    plain = settled(layout)
    poses, drafts = _close_pose(plain, groups, pairs if plain is layout else settled(pairs))
    return Sequence(layout, pairs, sums, groups, poses, drafts if plain is layout else {})


def _close_pose(layout: Layout, groups: Formation, pairs: Connections) -> tuple[Poses, Drafts]:
    """The pose in which all joints close, group after group, drivers held where they are.

    A dyad whose pose tells its mode is closed by its closed form, whose block is given as well.
    Raises `GraphError` where it is not found, too far off, or holds a group at a dead centre.
    """
    coordinates = {
        c: coordinate(layout.given, layout.pairs[c], layout.size) for c in layout.drivers
    }
    poses, stuck, drafts = dict(layout.given), [], {}
    for unit in groups.units:
        connections = tuple(pairs[p.name] for p in unit.pairs)
        closing = Closing(
            unit.links, connections, layout.size, {c: coordinates[c] for c in unit.driven}
        )
        home = unit.kind in ("group", "triad", "cylinder")  # others need to be seen, not placed
        start = {link: poses[link] for c in connections for link in c.links}
        draft = closed_form(unit, pairs, start, plain=True) if unit.kind in DYADS else None
        closed: Poses = {**start, **draft.poses} if draft else start
        if draft and draft.poses and closing.closed(closed):
            drafts[unit.links] = draft
        elif not closing.closed(closed := closing.refine(start, 0.0 if home else EPS)):
            raise GraphError(does_not_close(layout))
        if home and closing.freedom(closed)[0]:
            stuck.append(unit)
        poses |= closed
    away = list(far_off(layout, poses))
    if away or stuck:
        raise GraphError(away or why_stuck(layout, stuck))
    return poses, drafts


def _as_blocks(linkage: Linkage, order: Sequence, general: General) -> Parts:
    plain = links_read_as_they_are(linkage.loads, order.layout.pairs)
    plain |= links_sensed(linkage)
    diagram = Diagram(linkage, order)
    welds = order.layout.welds
    problems = [_turned_angle(link, welds[link].link) for link in plain if welds[link].e != 1]
    units = _merge_groups(order.formation.units) if general == "one" else order.formation.units
    for unit in units:
        draft = None
        if unit.kind == "driver":
            draft = driving_link(order.pairs[unit.outer[0].name], unit.links[0], order.pairs)
        elif not general:
            draft = order.drafts.get(unit.links) or closed_form(unit, order.pairs, order.poses)
        if draft and draft.doubt:
            problems.append(dead_centre(unit.links, draft.doubt))
        if draft is None or any(draft.seats[link].e != 1 for link in plain & set(draft.seats)):
            draft = general_group(unit, order.pairs)
        diagram.add(unit, draft)
    GraphError.raise_for(problems)
    diagram.add_loads()
    diagram.add_couplings()
    diagram.add_signals()
    order_of_blocks = Formation(tuple(units), (), ())
    names = diagram.names()  # it puts markers on links that have none
    return diagram.data(), names, order_of_blocks, None if general else linkage


def _turned_angle(link: str, carrier: str) -> Problem:
    """The problem of a law of a relative angle whose link is welded at an angle to its carrier."""
    message = (
        f"a law or a signal reads the angle of {link}, which is welded to {carrier} at an angle"
    )
    remedy = f"let it read the angle of {carrier}"
    return Problem("wrong-value", path_text(("links", link)), message, "", remedy)


def _merge_groups(units: tuple[Unit, ...]) -> tuple[Unit, ...]:
    """Drivers that stand on the frame or on each other, and all the rest as one group."""
    placed, drivers, rest = {FRAME}, [], []
    for unit in units:
        supports = {p.other(link) for p in unit.outer for link in unit.links if link in p.links}
        if unit.kind == "driver" and supports <= placed:
            drivers.append(unit)
            placed.update(unit.links)
        else:
            rest.append(unit)
    if not rest:
        return tuple(drivers)
    links = [link for unit in rest for link in unit.links]
    driven = [name for unit in rest for name in unit.driven]
    group = classify(links, [p for unit in rest for p in unit.pairs], driven)
    return (*drivers, replace(group, links=tuple(sorted(links)), kind="group", number=0))
