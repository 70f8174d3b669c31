"""Checks of motion: every pair closes, drivers stand where they were asked, modes are kept.

A link is a rigid body, so places, velocities and accelerations of both links of a pair follow
from its motion alone; the pair says which of their differences are nothing. Differentiated
exactly, so that rounding is all that is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from blockmech.analysis.evidence import Evidence, Residual, Stretches
from blockmech.analysis.free_bodies import Body
from blockmech.blocks.modes import FOLLOW
from blockmech.model.laws_of_motion import OverRange
from blockmech.model.spots import marker_place
from blockmech.model.structure import JointRef, LinkRef
from blockmech.typing import Array

ACROSS = {"RRR": False, "RRP": True, "RPR": True, "RPP": False, "PRP": False}
"""Dyads, and whether their dead centre is where two directions are square to each other."""


def closures(e: Evidence) -> Iterator[Residual]:
    """The two links of each pair stay together, and slip as reported.

    A group is solved as a whole: its pairs' equations carry the rounding of all of them.
    """
    for block, kind in e.structure.blocks.items():
        ends = {ref: e.bodies.ends(ref) for ref in (JointRef(block, n) for n in kind.joints)}
        sizes = np.sum([earlier.sizes(later) for earlier, later in ends.values()], axis=0)
        rate, spin = (
            sum(np.abs(getattr(b, x)) for e in ends.values() for b in e) for x in ("om", "al")
        )
        sizes[1] += rate * sizes[0]  # any link may turn about places that are rounded as all are
        sizes[2] += spin * sizes[0] + rate * sizes[1]
        sizes[1:] *= e.condition(block)
        reach = kind.largest_length() or 1.0
        for ref, (earlier, later) in ends.items():
            sliding, turns = kind.joints[ref.name].kind == "P", _turns(earlier, later)
            for k, relative in enumerate(earlier.seen(later)):
                residual = (np.conj(earlier.e) * relative).imag if sliding else relative
                yield Residual("closure of", ref, residual, sizes[k])
                if sliding:
                    size = np.abs(turns[k][0]) + np.abs(turns[k][1]) + sizes[k] / reach
                    yield Residual("closure of", ref, turns[k][1] - turns[k][0], size)
            residual = _slide_motion(earlier, later)[1] if sliding else turns[1][1] - turns[1][0]
            size = sizes[1] if sliding else sizes[1] / reach + np.abs(earlier.om) + np.abs(later.om)
            yield Residual("closure of", ref, residual - e.run[f"{ref}.slip"], size)


def markers(e: Evidence) -> Iterator[Residual]:
    """Every marker moves with its link."""
    for block in (e.structure.frame, *e.structure.blocks):
        for marker in e.structure.markers(block):
            body = e.bodies.link(marker.on)
            point = body.at(marker_place(e.structure, marker))
            sizes = body.sizes(point)
            for k, quantity in enumerate("pva"):
                residual = point[k] - e.run[f"{marker}.{quantity}"]
                yield Residual("markers on", marker.on, residual, sizes[k])


def _turns(earlier: Body, later: Body) -> tuple[tuple[Array, Array], ...]:
    """Directions, rates and angular accelerations of both ends of a pair."""
    return (earlier.e, later.e), (earlier.om, later.om), (earlier.al, later.al)


def _slide_motion(earlier: Body, later: Body) -> list[Array]:
    """Way, rate and acceleration of a pair along its guide."""
    return [(np.conj(earlier.e) * relative).real for relative in earlier.seen(later)]


def drivers(e: Evidence) -> Iterator[Residual]:
    """Each driven pair has the coordinate, rate and acceleration that were asked for."""
    for driver, ref in e.structure.driven.items():
        earlier, later = e.bodies.ends(ref)
        sign, offset = e.structure.coordinate(driver)
        q, rate, acceleration = (e.run[f"{driver}.{x}"] for x in ("q", "rate", "acceleration"))
        prescribed = sign * q + offset, sign * rate, sign * acceleration
        condition = e.condition(ref.block)
        if e.structure.joint(ref).rotary:
            turn = later.e * np.conj(earlier.e) - np.exp(1j * prescribed[0])
            size = 1 + np.abs(q) + abs(offset)
            yield Residual("value of", driver, turn, size)
            for k, (a, b) in enumerate(_turns(earlier, later)[1:], start=1):
                size = np.abs(a) + np.abs(b) + np.abs(prescribed[k])
                yield Residual("value of", driver, b - a - prescribed[k], size * condition)
            continue
        for k, (travel, size) in enumerate(
            zip(_slide_motion(earlier, later), earlier.sizes(later), strict=True)
        ):
            size = (size + np.abs(prescribed[k]) + abs(offset)) * (condition if k else 1.0)
            yield Residual("value of", driver, travel - prescribed[k], size)


def laws_of_motion(e: Evidence) -> Iterator[Residual]:
    """Rate and acceleration of each law are its derivatives, here and there over its range."""
    for driver, law in e.run.mechanism.scene.drive.items():
        begin, lasts = law.begin(), law.duration()
        lasts = lasts if 0 < lasts < math.inf else 1.0
        over = Stretches.between(
            begin, begin + lasts, (x for x in law.kinks if begin < x < begin + lasts), e.run.n
        )
        q, rate, acceleration = (
            x.reshape(over.nodes.shape) for x in law.at_times(over.nodes.ravel())
        )
        for value, slope in ((q, rate), (rate, acceleration)):
            yield Residual(
                "law of motion of", driver, over.gap(value, slope), over.size(value, slope)
            )
        if isinstance(law, OverRange):
            q, rate = q[:, 0], rate[:, 0]
            _, speed, push = law.at_coordinates(q)
            size = rate**2 + 2 * np.abs(push) * (np.abs(q) + abs(law.start))
            yield Residual("law of motion of", driver, speed**2 - rate**2, size)


def modes(e: Evidence) -> Iterator[Residual]:
    """Each dyad is in the assembly mode that was asked for: the sign of its determinant."""
    for name, block in e.structure.blocks.items():
        if not hasattr(block, "branch"):
            continue
        ends = {joint: e.bodies.ends(JointRef(name, joint)) for joint in block.joints}
        B = ends["B"][1].p
        if "D" in ends:
            d, c = ends["D"][1].p - B, ends["C"][0].p - B if "C" in ends else ends["S"][0].e
            det = (np.conj(d) * c).imag if "C" in ends else (np.conj(c) * d).real
        else:
            d, c = ends["C"][0].p - B, ends["S"][0].e
            det = (np.conj(c) * d).real
        wrong = np.minimum(_requested_branch(e, name) * det, 0.0)
        yield Residual("mode of", name, wrong, np.abs(d) * np.abs(c))


def margins(e: Evidence) -> Iterator[Residual]:
    """The margin of a dyad is the squared sine of its transmission angle."""
    for name, block in e.structure.blocks.items():
        if (margin := e.run.quality.margin.get(name)) is None or block.kind not in ACROSS:
            continue
        first, second = (e.bodies.link(LinkRef(name, link)).e for link in block.link_names)
        if block.kind == "RPR":
            d = e.bodies.ends(JointRef(name, "D"))[0].p - e.bodies.ends(JointRef(name, "B"))[0].p
            second = d / np.abs(d)
        product = np.conj(first) * second
        sine = np.abs(product.real if ACROSS[block.kind] else product.imag)
        yield Residual("margin of", name, margin - sine**2, 1 + 0 * sine)
        angle = e.run[f"{name}.transmission_angle"]
        yield Residual("transmission angle of", name, np.sin(angle) - sine, 1 + 0 * sine)


def _requested_branch(e: Evidence, name: str) -> Array | int:
    """The branch that a dyad was asked for; one that follows changes at each change point."""
    block: Any = e.structure.blocks[name]
    if block.branch != FOLLOW:
        branch: int = block.branch
        return branch
    ((driver, home),) = block.home.drivers.items()
    q, change_points = e.run[f"{driver}.q"], e.structure.followed[name]
    rotary = e.structure.driver_joint(driver).rotary
    passed = np.zeros(e.run.n)
    for point in change_points.points:
        offset, home_offset = q - point, home - point
        if rotary:  # once a turn
            passed += np.floor(offset / math.tau) - math.floor(home_offset / math.tau)
        else:
            passed += (offset > 0) != (home_offset > 0)
    sign_now: Array = block.home.branch * (1 - 2 * (passed % 2))
    return sign_now
