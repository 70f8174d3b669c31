"""Outputs of a joint-based document: its own links, joints and drivers, whatever the blocks.

Every output here is a sum of some of the graph's (`outputs.by_block`), each with a sign, read
in the frame and under the name of the document: one table says which (`readings`).

Signs. The graph reports a pair's reaction, friction and slip on its later link; a document
wants them on the joint's second link. Where the second is the earlier one (``flipped``), all
change sign: force and couple by action and reaction (C about the same slider's point), rates
because they are seen from the other link. What is measured along or across a guide (N along
n = i u, friction and slip along u) changes once more where the graph's guide points against
the document's (``turned``). Power never changes.

A pin of more than two links is one pair for each further link, named after it:
``joint.A.rod.reaction`` is the force of the first link of A on ``rod``; the place ``joint.A.p``
is that of all. Where the graph seats the pin on another link, the forces of several pairs add up
to it. The transmission angle of a dyad is that at the joint inside it, at a pin of more links
named after the dyad's two, ``joint.A.rocker.rod.transmission_angle``: whatever order was found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

from blockmech.ground.plane import within_half_turn
from blockmech.model.naming import JointName, LinkName, Names
from blockmech.model.structure import JointRef, LinkRef, Structure
from blockmech.outputs.by_owner import ByOwner, Part
from blockmech.plan.plan import Output
from blockmech.typing import Complex, Nested, Real

OF_LINKS = ("angle", "omega", "alpha")
OF_POINTS = ("p", "v", "a")
OF_PLAY = ("play", "play_bound")
OF_JOINTS = (
    *("reaction", "N", "C", "friction", "coordinate", "slip", "friction_power"),
    *("deflection", "stored_power"),
)
OF_DRIVERS = (
    *("q", "rate", "acceleration", "drive", "drive_by_reduction"),
    *("power", "J_red", "tau_red", "dJ_red"),
)


class Reading(NamedTuple):
    """How an output of the document is read.

    name : in the document
    parts : outputs of the graph that add up to it, each with its sign +1 or -1
    turn : [rad] what is added to an angle, which stays between -pi and pi
    between : the links that exert it and that it acts on, if it is other than the first part's
    wrapped : whether the sum is an angle that has to be brought between -pi and pi
    shift : [m] what is added to a length
    """

    name: str
    parts: tuple[tuple[str, int], ...]
    turn: float = 0.0
    between: tuple[str, str] | None = None
    wrapped: bool = False
    shift: float = 0.0


def outputs_by_link(
    structure: Structure, names: Names, of_blocks: Mapping[str, Output]
) -> Callable[[Reading], Output]:
    """What makes the outputs of a joint-based document of their `readings`.

    Parameters
    ----------
    structure : of the graph that was made of the document
    names : where links and joints of the document are in the graph
    of_blocks : the graph's outputs by name
    """
    link_names = {str(ref): link for ref, link in names.of_links.items()}
    link_names[str(structure.frame_link)] = "frame"

    def made(reading: Reading) -> Output:
        parts = [(of_blocks[name], sign) for name, sign in reading.parts]
        output = _sum(parts) if len(parts) > 1 or parts[0][1] < 0 else parts[0][0]
        if reading.turn or reading.wrapped or reading.shift:
            output = _counted_from(output, reading)
        by, on = (link_names.get(link, link) for link in (output.by, output.on))
        if reading.between:
            by, on = (x or y for x, y in zip(reading.between, (by, on), strict=True))
        return output._replace(name=reading.name, by=by, on=on)

    return made


def readings(
    structure: Structure, names: Names, outputs: ByOwner[Output]
) -> Iterator[Part[Reading]]:
    """The name table of a document: drivers, links, joints, loads, signals, the whole."""
    pairs = {pair.joint: pair.links for pair in names.joints.values()}
    driven = {ref: driver for driver, ref in structure.driven.items()}

    def of(owner: str, make: Callable[..., Iterator[Reading]], *arguments: Any) -> Part[Reading]:
        """An owner's readings, without outputs of the graph that there are not."""
        return owner, _available, (outputs, make, arguments)

    for ref, driver in driven.items():
        yield of(f"driver.{driver}", _of_driver, driver, pairs.get(ref))
    for link, at in names.links.items():
        yield of(f"link.{link}", _of_link, link, at, at.link == structure.frame_link)
    for pin, entries in groupby(names.joints.items(), lambda item: item[0].partition(".")[0]):
        yield of(f"joint.{pin}", _of_pin, pin, dict(entries), structure, names, outputs, driven)
    for name, block in {**names.couplings, **names.signals}.items():
        yield of(name, _of_blocks, name, (block,), outputs)
    for load, elements in names.loads.items():
        yield of(load, _of_blocks, load, elements, outputs, (load, ""))
    yield of("mechanism", _of_blocks, "mechanism", ("mechanism",), outputs)


def _available(
    outputs: Mapping[str, Output],
    make: Callable[..., Iterator[Reading]],
    arguments: tuple[Any, ...],
    last: str,
) -> Iterator[Reading]:
    """The readings there are, among them all with this last word; "" for any."""
    for reading in make(last, *arguments):
        if parts := tuple(part for part in reading.parts if part[0] in outputs):
            yield reading if parts == reading.parts else reading._replace(parts=parts)


def _matching(quantities: Iterable[str], last: str) -> list[str]:
    return [quantity for quantity in quantities if last in ("", quantity)]


def _of_driver(last: str, driver: str, between: tuple[str, str] | None) -> Iterator[Reading]:
    for quantity in _matching(OF_DRIVERS, last):
        yield Reading(
            f"driver.{driver}.{quantity}", ((f"{driver}.{quantity}", 1),), between=between
        )


def _of_link(last: str, link: str, at: LinkName, fixed: bool) -> Iterator[Reading]:
    if not fixed:
        for quantity in OF_PLAY:
            yield Reading(f"link.{link}.{quantity}", ((f"{at.marker}.{quantity}", 1),))
        for point, turn in zip(OF_POINTS, OF_LINKS, strict=True):
            yield Reading(f"link.{link}.{point}", ((f"{at.marker}.{point}", 1),))
            offset = at.turn if turn == "angle" else 0.0
            yield Reading(f"link.{link}.{turn}", ((f"{at.link}.{turn}", 1),), offset)
    for marker, ref in at.markers.items():
        for quantity in _matching((*OF_POINTS, *OF_PLAY), last):
            yield Reading(f"link.{link}.{marker}.{quantity}", ((f"{ref}.{quantity}", 1),))


def _of_blocks(
    last: str,
    name: str,
    blocks: Sequence[str],
    outputs: ByOwner[Output],
    between: tuple[str, str] | None = None,
) -> Iterator[Reading]:
    """What blocks give together: of a load at its terminals, and its power."""
    for output in (x for x in outputs.of(blocks[0]) if x.endswith(last)):
        quantity = output.removeprefix(blocks[0])
        together = blocks[:1] if quantity == ".length" else blocks  # spring and damper share it
        parts = tuple((f"{block}{quantity}", 1) for block in together)
        yield Reading(f"{name}{quantity}", parts, between=between)


def _of_pin(
    last: str,
    pin: str,
    pairs: Mapping[str, JointName],
    structure: Structure,
    names: Names,
    outputs: Mapping[str, Output],
    driven: Mapping[JointRef, str],
) -> Iterator[Reading]:
    """The place of a pin, what each of its pairs does, and the angles of dyads with it inside."""
    first = next(iter(pairs.values())).joint
    points = OF_POINTS if structure.joint(first).rotary else ()  # a guide is at no one place
    for quantity in _matching(points, last):
        yield Reading(f"joint.{pin}.{quantity}", ((f"{first}.{quantity}", 1),))
    for name, pair in pairs.items():
        for quantity in _matching(OF_JOINTS, last):
            joint, driver = structure.joint(pair.joint), driven.get(pair.joint)
            if quantity == "coordinate" and (joint.rotary or driver is not None):
                yield _coordinate(name, pair, driver, names)
            elif f"{pair.joint}.{quantity}" in outputs:
                parts = _of_joint(quantity, pair, structure, names)
                shift = pair.shift if quantity == "coordinate" else 0.0
                output = f"joint.{name}.{quantity}"
                yield Reading(output, parts, between=pair.links, shift=shift)
    members = {ref for pair in pairs.values() for ref, _ in ((pair.joint, False), *pair.others)}
    for ref in sorted(members) if last in ("", "transmission_angle") else ():
        angle, joint = f"{ref.block}.transmission_angle", structure.joint(ref)
        if angle in outputs and not (joint.outer or joint.driven):
            two = sorted(names.of_links[LinkRef(ref.block, link)] for link in joint.links)
            name = pin if len(pairs) == 1 else ".".join([pin, *two])
            yield Reading(f"joint.{name}.transmission_angle", ((angle, 1),))


def _coordinate(name: str, pair: JointName, driver: str | None, names: Names) -> Reading:
    """Angle of the second link's axes against the first's; of a driven pair the driver's."""
    output = f"joint.{name}.coordinate"
    if driver is not None:
        return Reading(output, ((f"{driver}.q", 1),), between=pair.links)
    parts, turn = list[tuple[str, int]](), 0.0
    for link, sign in zip(pair.links, (-1, 1), strict=True):
        if link in names.links:
            at = names.links[link]
            parts.append((f"{at.link}.angle", sign))  # which there is not of the frame
            turn = turn + sign * at.turn  # a dual number, too, where places vary
    return Reading(output, tuple(parts), turn, pair.links, wrapped=True)


def _of_joint(
    quantity: str, pair: JointName, structure: Structure, names: Names
) -> tuple[tuple[str, int], ...]:
    """What an output of a joint is the sum of."""
    first = (f"{pair.joint}.{quantity}", -1 if pair.flipped else 1)
    if quantity == "reaction":
        return first, *((f"{ref}.{quantity}", -1 if back else 1) for ref, back in pair.others)
    if quantity in ("friction_power", "stored_power"):
        return ((first[0], 1),)
    lengthwise = structure.joint(pair.joint).kind == "P" and quantity != "C"
    ends = {structure.earlier_link(pair.joint), structure.later_link(pair.joint)}
    frame = structure.frame_link
    mine = [names.links[a].link if a in names.links else frame for a in pair.links]
    if quantity == "slip" and set(mine) != ends:  # of a pin that is seated on other links
        rates = zip(mine, (-1, 1), strict=True)
        return tuple((f"{link}.omega", sign) for link, sign in rates if link != frame)
    return ((first[0], -first[1] if lengthwise and pair.turned else first[1]),)


def _sum(parts: list[tuple[Output, int]]) -> Output:
    """A sum of outputs of one value each, declared like the first."""
    first, sign = parts[0]
    if len(parts) == 1:
        return first._replace(read=lambda *values: _signed(first, first.read(*values), sign))

    def total(*columns: Nested) -> Complex:
        terms = [_signed(p, p.read(x), n) for (p, n), x in zip(parts, columns, strict=True)]
        return sum(terms[1:], start=terms[0])

    return first._replace(ask=lambda s: [v for p, _ in parts for v in p.ask(s)], read=total)


def _signed(output: Output, x: Complex, sign: int) -> Complex:
    return x if sign > 0 else -x if output.kind == "vector" else 0.0 - x  # no -0


def _counted_from(output: Output, reading: Reading) -> Output:
    """A length that counts more by a shift, or the angle of a turned frame between -pi and pi."""

    def read(*values: Nested) -> Real:
        x = output.read(*values) + (reading.turn or reading.shift)
        return x if reading.shift else within_half_turn(x)

    return output._replace(read=read)
