"""Verify: balances and powers of a computed mechanism, from its outputs alone.

The checks use labelled outputs (reactions, places, rates), not the kernels that
made them: the balance of every link, the power through every block, the power
balance of the whole, and the driving effort by reactions against reduction.

Sources: [R10] Eqs. 2-7 and 12-16 (balances), [D14] Eqs. 3-6 (reduction).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.analysis.free_bodies import Array, FreeBodies
from blockmech.model.structure import JointRef, LinkRef

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.result import Result

TOLERANCE = 1e-12  # of the sum of absolute terms, times the conditioning
ROUNDING = 2.0**-46  # of all forces from which a reaction is solved: 128 roundings of 2**-53
SAMPLES = 25


@dataclass(frozen=True)
class Check:
    """One check: the largest relative error over the samples, and what is allowed.

    ``value`` is in units of the sum of absolute terms times the conditioning [-].
    """

    name: str
    value: float
    allowed: float = TOLERANCE

    @property
    def ok(self) -> bool:
        """Whether the check holds."""
        return self.value <= self.allowed


@dataclass(frozen=True)
class Verification:
    """All checks of a mechanism.

    Attributes
    ----------
    rows : the checks
    samples : number of samples with an answer that were checked
    conditioning : largest conditioning met [-]
    """

    rows: tuple[Check, ...]
    samples: int
    conditioning: float

    @property
    def ok(self) -> bool:
        """Whether every check holds and there was something to check."""
        return self.samples > 0 and all(r.ok for r in self.rows)

    def __str__(self) -> str:
        width = max((len(r.name) for r in self.rows), default=4)
        lines = [f"{'check':<{width}}  error [-]  allowed [-]"]
        lines += [
            f"{r.name:<{width}}  {r.value:9.2e}  {r.allowed:9.2e}  {'ok' if r.ok else 'FAILS'}"
            for r in self.rows
        ]
        lines.append(
            f"{self.samples} samples; errors are relative to the sum of absolute terms "
            f"times the conditioning (at most {self.conditioning:.3g})"
        )
        return "\n".join(lines)


def verify(mechanism: Compiled, **request: Any) -> Verification:
    """Check a mechanism against itself over some samples.

    Parameters
    ----------
    request : as for `Compiled.run` (at, samples, times, friction ...); by default
        25 samples of the laws' ranges with friction by Newton. Gaps are left out.

    Returns
    -------
    Verification, with a number for each check
    """
    if not {"at", "samples", "times"} & set(request):
        request["samples"] = SAMPLES
    request |= {"want": ("*",), "on_gap": "mark"}
    run = mechanism.of_blocks.run
    judge = _Judge(run(**request))
    smooth = {k: v for k, v in request.items() if k not in ("tolerance", "iterations")}
    drives = _Judge(run(**smooth | {"friction": "none"})).drives()
    rows = [*judge.links(), *judge.blocks(), judge.whole(), *drives]
    said = _checks_said(mechanism)
    rows = [replace(row, name=said.get(row.name, row.name)) for row in rows]
    return Verification(tuple(rows), int(judge.good.sum()), float(judge.worst))


def _checks_said(mechanism: Compiled) -> dict[str, str]:
    """Name of a check -> the same in the words of a document of joints, if there is one."""
    if mechanism.names is None:
        return {}
    blocks = mechanism.structure.blocks
    found = {f"power through {b}": f"power through {mechanism.said(b)}" for b in blocks}
    for name, link in mechanism.names.links.items():
        found |= {f"{what} on {link.link}": f"{what} on {name}" for what in ("forces", "moments")}
    for name in mechanism.drivers:
        drive = mechanism.of_driver(name, "drive")
        found[f"two routes to {name}.drive"] = f"two routes to {drive}"
    return found


class Term(NamedTuple):
    """A term of a balance and its absolute size, factor by factor.

    The size of a moment is |arm| |force|, not its value: rounding of a large force
    along its arm is not seen in the value.
    """

    value: Array
    size: Array


class Balance(NamedTuple):
    """Terms of the force and of the moment balance of a link, about its origin.

    ``reach`` is the largest sum of coordinates [m] whose difference is an arm: no rounding of
    a force acts farther from the origin, and an arm is known to the rounding of this.
    """

    forces: list[Term]
    moments: list[Term]
    reach: Array


class Sizes(NamedTuple):
    """Sums of absolute forces [N], moments [N m] and powers [W] of a block."""

    force: Array
    moment: Array
    power: Array


def _plain(x: Array) -> Term:
    return Term(np.asarray(x), np.abs(x))


def _moment(arm: Array, force: Array) -> Term:
    return Term((np.conj(arm) * force).imag, np.abs(arm) * np.abs(force))


def _power(force: Array, v: Array) -> Term:
    return Term((np.conj(force) * v).real, np.abs(force) * np.abs(v))


def _size(terms: list[Term]) -> Array:
    """Sum of absolute terms."""
    return np.asarray(np.sum([t.size for t in terms], axis=0))


class _Judge:
    """Sums of terms over the samples of one result."""

    def __init__(self, run: Result) -> None:
        self.run = run
        self.structure = run.mechanism.structure
        self.bodies = FreeBodies(run)
        self.good = np.array([s == "ok" for s in run.quality.status])
        self.condition = self._conditioning()
        self.worst = max(
            (c[self.good].max(initial=1.0) for c in self.condition.values()), default=1.0
        )

    def _conditioning(self) -> dict[str, Array]:
        """Digits that dead centres may cost: 1 / sqrt(margin) multiplied along the supports."""
        found: dict[str, Array] = {self.structure.frame: np.ones(self.run.n)}
        margins = self.run.quality.margin
        for block in self.structure.blocks:
            own = found[self.structure.frame]
            for support in self.structure.supports(block):
                own = np.maximum(own, found[support])
            if block in margins:
                with np.errstate(all="ignore"):
                    own = own / np.sqrt(margins[block])
            found[block] = own
        return found

    def _error(self, name: str, terms: list[Term], scale: Array) -> Check:
        if not terms or not self.good.any():
            return Check(name, 0.0)
        total, scale = np.abs(np.sum([t.value for t in terms], axis=0))[self.good], scale[self.good]
        return Check(
            name, float(np.max(np.where(total == 0, 0.0, total / np.where(scale, scale, 1))))
        )

    # -- the checks -----------------------------------------------------------------

    def links(self) -> Iterator[Check]:
        """Force and moment balance of every moving link."""
        for link, balance in self._balances.items():
            condition, size = self._below(link.block), self._sizes[link.block]
            yield self._error(f"forces on {link}", balance.forces, size.force * condition)
            yield self._error(f"moments on {link}", balance.moments, size.moment * condition)

    @cached_property
    def _balances(self) -> dict[LinkRef, Balance]:
        """The balances of each moving link."""
        found = {}
        for link in self.structure.links:
            if link != self.structure.frame_link:
                o, terms = self.bodies.link(link)[0], list(self.bodies.terms(link))
                moments = [_plain(m) for _, _, m in terms]
                moments += [_moment(p - o, f) for f, p, _ in terms]
                reach = np.max([np.abs(p) + np.abs(o) for _, p, _ in terms], axis=0)
                found[link] = Balance([_plain(f) for f, _, _ in terms], moments, reach)
        return found

    @cached_property
    def _sizes(self) -> dict[str, Sizes]:
        """Sums of absolute terms of each block, or of one that loads it.

        Loads of a group may cancel within it and leave a link, and the blocks before it,
        nothing but their rounding: that is measured by the loads themselves. The reactions
        of a block are solved from all its loads at once, so any of them may carry the
        rounding of the sum of all forces. At its arm it is a moment, at its speed a power,
        also where the terms themselves are nothing: loads that go straight into one pin, or
        pass it by less than coordinates show. Only `ROUNDING` is allowed to these.
        """
        share = ROUNDING / TOLERANCE
        found: dict[str, Sizes] = {}
        for name, block in reversed(list(self.structure.blocks.items())):
            own = [self._balances[LinkRef(name, link)] for link in block.link_names]
            later = [found[b] for b in found if name in self.structure.supports(b)]
            force = np.sum([_size(link.forces) for link in own], axis=0)
            force = np.max([force, *(block.force for block in later)], axis=0)
            reach = np.max([link.reach for link in own], axis=0)
            moment = np.sum([_size(link.moments) for link in own], axis=0)
            v, om = self._speeds(name)
            power = _size(self._powers[name]) + share * (force * v + (moment + force * reach) * om)
            moment = moment + share * force * reach
            found[name] = Sizes(
                force,
                np.max([moment, *(block.moment for block in later)], axis=0),
                np.max([power, *(block.power for block in later)], axis=0),
            )
        return found

    def _speeds(self, block: str) -> tuple[Array, Array]:
        """Largest speed [m/s] and rate [rad/s] of a block's links, and of what they hang on."""
        structure, kind = self.structure, self.structure.blocks[block]
        links = [self.bodies.link(LinkRef(block, link)) for link in kind.link_names]
        outer = [JointRef(block, j.name) for j in kind.joints.values() if j.outer]
        wired = [self.run[f"{structure.feeds[ref]}.v"] for ref in outer]
        v = np.max(np.abs([*(v for _, v, _, _ in links), *wired]), axis=0)
        return v, np.max(np.abs([om for _, _, om, _ in links]), axis=0)

    def _below(self, block: str) -> Array:
        """Conditioning of a block and of all blocks that load it."""
        later = [b for b in self.structure.blocks if block in self.structure.ancestors(b)]
        found: Array = np.max([self.condition[b] for b in later], axis=0)
        return found

    def blocks(self) -> Iterator[Check]:
        """Power through every block: what wires bring is taken out, lost or stored."""
        for name, terms in self._powers.items():
            scale = self._sizes[name].power * self._below(name)
            yield self._error(f"power through {name}", terms, scale)

    @cached_property
    def _powers(self) -> dict[str, list[Term]]:
        """Terms of the power balance of each block."""
        r, found = self.run, {}
        for name, block in self.structure.blocks.items():
            terms: list[Term] = []
            for joint in block.joints.values():
                ref = JointRef(name, joint.name)
                terms.append(_plain(-r[f"{ref}.friction_power"]))
                if joint.outer:
                    terms += self._wire(ref, -1.0)
            terms += [_plain(r[f"{d}.power"]) for d in self.structure.drivers_of(name)]
            for link_name in block.link_names:
                link = LinkRef(name, link_name)
                for child in self.structure.carried[link]:
                    terms += self._wire(child, 1.0)
                terms += self._power_of_loads(link)
            found[name] = terms
        return found

    def _wire(self, ref: JointRef, sign: float) -> list[Term]:
        """Power that a wire gives to its support, times a sign."""
        marker = self.structure.feeds[ref]
        om = self.bodies.link(marker.on)[2]
        v = self.run[f"{marker}.v"]
        force, moment = self.run[f"{ref}.wrench_F"], self.run[f"{ref}.wrench_M"]
        return [_power(sign * force, v), _plain(sign * moment * om)]

    def _power_of_loads(self, link: LinkRef) -> list[Term]:
        o, v, om, _ = self.bodies.link(link)
        found = []
        for source in (self.bodies.inertia_and_weight(link), self.bodies.elements(link)):
            for force, place, couple in source:
                found.append(_power(force, v + 1j * om * (place - o)))
                found.append(_plain(couple * om))
        return found

    def whole(self) -> Check:
        """Drive power + load power - friction power = rate of kinetic energy."""
        r = self.run
        terms = [_plain(r[f"{d}.power"]) for d in self.structure.drivers]
        terms.append(_plain(-np.asarray(r["mechanism.friction_power"])))
        for link in self.structure.links:
            terms += self._power_of_loads(link)
        condition = np.max(list(self.condition.values()), axis=0)
        flows = [size.power for size in self._sizes.values()]  # what may cancel in the whole
        return self._error(
            "power of the whole", terms, np.max([_size(terms), *flows], axis=0) * condition
        )

    def drives(self) -> Iterator[Check]:
        """Driving effort by reactions against the one by reduction, without friction."""
        r, worst = self.run, np.max(list(self.condition.values()), axis=0)
        for driver in self.structure.drivers:
            difference = r[f"{driver}.drive"] - r[f"{driver}.drive_by_reduction"]
            size = self._sizes[self.structure.driven[driver].block]
            rotary = self.structure.driver_joint(driver).rotary
            scale = (size.moment if rotary else size.force) * worst
            yield self._error(f"two routes to {driver}.drive", [_plain(difference)], scale)
