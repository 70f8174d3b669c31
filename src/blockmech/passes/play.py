"""Play: how far clearance in pins displaces a place.

A journal with radial clearance c lies against its bush, as if a massless link of length c along
the reaction R joined the two centres. R is the force of the earlier link on the later one, so
the later link's centre is off the earlier one's by -c R/|R|. With the drivers held, the principle
of virtual work says what that does to a place: to first order in c

    play along x = sum_j c_j dot(R_j^x, R_j/|R_j|)

where R_j^x are the reactions to a unit load along x at the place alone, from one more force pass;
likewise along y. Whichever way the reactions point, it is at most sum_j c_j |R_j^x|.

Sources: Earles & Wu 1973 for the massless link; the principle of virtual work.
"""

from __future__ import annotations

from blockmech.ground.plane import dot, hyp, mul, planar, where
from blockmech.model.structure import JointRef, MarkerRef, Structure
from blockmech.passes import forces
from blockmech.plan.plan import Schedule, UnitLoad
from blockmech.plan.values import ZERO, Value
from blockmech.typing import Complex, Real


def loose_pins(structure: Structure, block: str) -> tuple[JointRef, ...]:
    """Pins with clearance on which the places of a block depend."""
    blocks = structure.ancestors(block)
    return tuple(
        JointRef(name, joint)
        for name, declared in structure.blocks.items()
        if name in blocks
        for joint in declared.clearance
    )


def play(s: Schedule, marker: MarkerRef) -> Value:
    """Displacement [m] of a place where every journal lies as its reaction presses it."""
    terms = []
    for ref in loose_pins(s.structure, marker.block):
        pressed = s.ask(forces.reaction, ref)
        if pressed is not None:  # a journal without a load counts as centred
            args = (pressed, *unit_reactions(s, ref, marker), clearance(s, ref))
            terms.append(s.emit(displacement, *args, name=f"{marker}_play"))
    return s.sum(terms, f"{marker}_play", ZERO)


def play_bound(s: Schedule, marker: MarkerRef) -> Value:
    """The most [m] that the play can be along x and along y."""
    terms = [
        s.emit(
            largest, *unit_reactions(s, ref, marker), clearance(s, ref), name=f"{marker}_play_bound"
        )
        for ref in loose_pins(s.structure, marker.block)
    ]
    return s.sum(terms, f"{marker}_play_bound", ZERO)


def pressing(s: Schedule, ref: JointRef) -> Value:
    """The reaction [N] that presses a journal against its bush; zero where nothing loads it."""
    return s.ask(forces.reaction, ref) or ZERO


def unit_reactions(s: Schedule, ref: JointRef, marker: MarkerRef) -> tuple[Value, Value]:
    """Reactions of a pin to unit loads at a place, along x and along y."""
    x, y = (s.ask(Schedule.under, UnitLoad(marker, axis)) for axis in ("x", "y"))
    return x.ask(forces.reaction, ref) or ZERO, y.ask(forces.reaction, ref) or ZERO


def clearance(s: Schedule, ref: JointRef) -> Value:
    """Slot of a pin's radial clearance [m]."""
    block, joint = ref
    return s.parameter(
        ("clearance", ref), lambda st, _: st.blocks[block].clearance[joint], f"{ref}_clearance"
    )


def displacement(R: Complex, R_x: Complex, R_y: Complex, c: Real) -> Complex:
    """Share of a pin [m] in the play of a place; none where nothing presses its journal."""
    size = hyp(R)
    n = mul(R, c / where(size > 0.0, size, 1.0))
    return planar(dot(R_x, n), dot(R_y, n))


def largest(R_x: Complex, R_y: Complex, c: Real) -> Complex:
    """The most [m] that a pin adds to the play along x and along y."""
    return planar(c * hyp(R_x), c * hyp(R_y))
