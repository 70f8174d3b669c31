"""Where the parts of a coupling are, along the chains of drivers that carry them."""

from __future__ import annotations

from collections.abc import Iterator

from blockmech.blocks.contract import BuiltIn
from blockmech.couplings.contract import Meshing, Transmission, Where
from blockmech.ground.errors import GraphError, Problem
from blockmech.ground.tolerances import ROUNDING
from blockmech.model.structure import SAME_CARRIER, JointRef, LinkRef, MarkerRef, Structure
from blockmech.typing import Guide, LinkPosition, Parameters

STILL = Transmission(0.0, 0.0, 0.0)


def check_couplings(s: Structure) -> None:
    """Raise `GraphError` with all couplings whose parts do not fit where they are."""
    problems: list[Problem] = []
    for name, coupling in s.couplings.items():
        try:
            s.follower(name)
            problems += _changing_distance(s, name)
            pair, p = s.coupled_pair(name), coupling_numbers(s, name)
            problems += coupling.faults(name, pair, sides(s, name), p)
        except GraphError as error:
            problems += error.problems
        except ArithmeticError:
            message = "its numbers lead to others beyond the range of floating-point numbers"
            remedy = "check units and powers of ten"
            problems.append(Problem("wrong-value", name, message, "", remedy))
    GraphError.raise_for(problems)


def _changing_distance(s: Structure, name: str) -> Iterator[Problem]:
    """The pairs that carry one wheel, where they do not turn about the other."""
    coupling, follower = s.couplings[name], s.follower(name)
    driven = s.feeds[s.driven[coupling.driven]]
    if not coupling.meshes or driven.on == follower.centre.on:
        return
    driven_turns = driven.on in s.turning(follower.centre.on)
    carrier, wheel = (follower.centre, driven) if driven_turns else (driven, follower.centre)
    link, centre = carrier.on, _guide(s, wheel).p
    while link != wheel.on:
        (driver,) = s.drivers_of(link.block)
        pivot = s.feeds[s.driven[driver]]
        pivot_position = _guide(s, pivot).p
        coincident = abs(pivot_position - centre) <= ROUNDING * (abs(pivot_position) + abs(centre))
        if not (coincident and s.driver_joint(driver).rotary):
            message = f"{carrier.on} carries the one wheel about {pivot}, not about the other "
            message += f"wheel's centre {wheel}, so their distance changes"
            yield Problem("coupling-mismatch", name, message, "", SAME_CARRIER)
            return
        link = pivot.on


def coupling_numbers(s: Structure, name: str) -> Parameters:
    """What a coupling's kernels read as ``p``."""
    return s.couplings[name].numbers(s.coupled_pair(name), lambda: _meshing(s, name, 0.0, STILL))


def sides(s: Structure, name: str) -> Where:
    """Both sides of a coupling at an argument, in the axes of what carries them."""
    kernel, p = s.couplings[name].transmission(s.coupled_pair(name)), coupling_numbers(s, name)
    return lambda x: _meshing(s, name, x, kernel(x, p))


def _meshing(s: Structure, name: str, x: float, motion: Transmission) -> Meshing:
    follower, ref = s.follower(name), s.driven[s.couplings[name].driven]
    guides = _guide(s, follower.centre), _guide(s, s.feeds[ref])
    lead, link = at_zero(s, s.leading_link(follower)), _pose(s, ref, guides[1], motion.q)
    return Meshing(*guides, Guide(*lead), Guide(*link), x, motion)


def _guide(s: Structure, marker: MarkerRef) -> Guide:
    """A marker where all drivers are at 0."""
    o, e = at_zero(s, marker.on)
    declared, block = s.marker(marker), s.block(marker.block)
    u = 1 + 0j if isinstance(declared, BuiltIn) else declared.direction
    return Guide(o + e * block.place_of(declared), e * u)


def at_zero(s: Structure, link: LinkRef) -> LinkPosition:
    """A link where all drivers are at 0; in its own axes if no chain of drivers carries it."""
    if link == s.frame_link or s.blocks[link.block].closes:
        return LinkPosition(0j, 1 + 0j)
    ref = s.driven[s.drivers_of(link.block)[0]]
    return _pose(s, ref, _guide(s, s.feeds[ref]), 0.0)


def _pose(s: Structure, ref: JointRef, guide: Guide, q: float) -> LinkPosition:
    """The later link of a driven pair, its coordinate being q more than its driver's offset."""
    block, joint = s.blocks[ref.block], s.joint(ref)
    joint_pose = guide if joint.reads == "guide" else guide.p
    coordinate = q + block.coordinate(ref.name).offset
    pose = block.kernels.position(joint_pose, coordinate, block.parameters())
    return LinkPosition(*getattr(pose, block.link_field(joint.later)))
