"""Outputs along a motion over several charts: each leg is read in its own, by the user's names.

A document's links and joints have their names in all charts. Outputs of blocks are found in the
links and joints that the blocks are said by: a marker is carried by its link, p + r, v + i w r,
a + (i w' - w^2) r, and a pair does what the joint does. A driver that does not lead has the
coordinate of its joint, x'' = r q'' + drift, and its drive gives nothing.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from blockmech.dynamics.motion_outputs import (
    STATIC,
    SimulationResult,
    result_in_chart,
    settings_along,
)
from blockmech.model.naming import Names
from blockmech.model.spots import marker_place
from blockmech.model.structure import LinkRef
from blockmech.outputs.by_block import PARTS
from blockmech.outputs.by_link import readings, wrapped
from blockmech.plan.settings import friction_asked
from blockmech.result.motion import Floats, Motion
from blockmech.result.quality import Flag, Quality
from blockmech.result.result import FREE
from blockmech.result.samples import Samples
from blockmech.typing import FrictionMethod, M

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.dynamics.legs import Leg

Recipe: TypeAlias = tuple[tuple[str, ...], Callable[..., Any]]
"""Names of outputs, and what is made of them (n,)."""
IDLE = ("drive", "drive_by_reduction", "power")  # of a driver that is free
MOVED: Mapping[str, tuple[tuple[str, ...], Callable[..., Any]]] = {  # a place r of a link
    "p": (("p",), lambda r, p: p + r),
    "v": (("v", "omega"), lambda r, v, omega: v + 1j * omega * r),
    "a": (("a", "omega", "alpha"), lambda r, a, omega, alpha: a + (1j * alpha - omega**2) * r),
}


def _same(x: Any) -> Any:
    return x


class InBlocks:
    """How outputs of blocks are read of the links and joints that the blocks are said by."""

    def __init__(self, blocks: Compiled, names: Names) -> None:
        """``names`` : where the links and joints are in the blocks."""
        self.s, self.names = blocks.structure, names
        self.links = {str(ref): ref for ref in self.s.links}
        self.markers = {str(m): m for block in self.s.blocks for m in self.s.markers(block)}
        self.markers |= {str(m): m for m in self.s.markers(self.s.frame)}
        self.joints = {str(x.joint): (name, x) for name, x in names.joints.items()}
        known = blocks.outputs.by_owner
        self.others = {
            reading.parts[0][0]: (reading.name, reading.parts[0][1])
            for _, make, more in readings(self.s, names, known)
            for reading in make(*more, "")
            if len(reading.parts) == 1 and not (reading.turn or reading.wrapped)
        }

    def __call__(self, name: str) -> Recipe | None:
        """Where an output comes from; None where there is none of the kind."""
        owner, _, what = name.rpartition(".")
        if what in PARTS:
            whole = self(owner)
            return whole and (whole[0], lambda *x: getattr(whole[1](*x), PARTS[what]))
        if what in MOVED and owner in self.markers:
            marker = self.markers[owner]
            return self._moved(marker.on, what, marker_place(self.s, marker))
        if owner in self.links and what in ("angle", "omega", "alpha"):
            return self._turned(self.links[owner], what)
        if owner in self.joints and what == "coordinate":
            return self._coordinate(*self.joints[owner])
        if name in self.others:
            other, sign = self.others[name]
            return (other,), _same if sign > 0 else np.negative
        return None

    def _moved(self, link: LinkRef, what: str, place: complex) -> Recipe:
        """A place [m] of a link."""
        if link == self.s.frame_link:
            return (), lambda: place if what == "p" else 0j
        doc = self.names.of_links[link]
        where = self.names.links[doc]
        arm = (place - marker_place(self.s, where.marker)) * cmath.rect(1.0, -where.turn)
        parts, made = MOVED[what]

        def read(angle: Floats, *values: Floats) -> Any:
            return made(arm * np.exp(1j * angle), *values)

        return tuple(f"link.{doc}.{x}" for x in ("angle", *parts)), read

    def _turned(self, link: LinkRef, what: str) -> Recipe:
        if link == self.s.frame_link:
            return (), lambda: 0.0
        doc = self.names.of_links[link]
        turn = self.names.links[doc].turn if what == "angle" else 0.0
        return (f"link.{doc}.{what}",), lambda x: wrapped(x - turn) if turn else x

    def _coordinate(self, name: str, pair: Any) -> Recipe:
        """Of a pin the angle between the axes of its two links."""
        ref = pair.joint
        if not self.s.joint(ref).rotary:
            sign = -1 if pair.flipped != pair.turned else 1
            return (f"joint.{name}.coordinate",), lambda x: sign * x
        one, first = self._turned(self.s.earlier_link(ref), "angle")
        two, second = self._turned(self.s.later_link(ref), "angle")

        def read(*angles: Floats) -> Any:
            return wrapped(second(*angles[len(one) :]) - first(*angles[: len(one)]))

        return (*one, *two), read


@dataclass
class LegOutputs:
    """Samples of a leg, and how the user's outputs are read there.

    at : which samples of the whole
    want : the user's names
    """

    of: Compiled
    leg: Leg
    at: Any
    t: Floats
    want: Sequence[str]
    settings: Mapping[str, Any]
    engine: str

    @cached_property
    def own(self) -> Compiled:
        """The mechanism that is asked: the user's where its own drivers lead from the start."""
        own = self.leg.chart.mechanism
        return self.of if own.structure is self.of.structure else own

    @cached_property
    def recipes(self) -> dict[str, Recipe | None]:
        """Where each output comes from; None of those that are read of the motion."""
        if self.own is self.of or (self.of.names is None) == (self.own.names is None):
            return {x: ((x,), _same) if x in self.own.outputs else None for x in self.want}
        assert self.leg.chart.names is not None
        recipe = InBlocks(self.of, self.leg.chart.names)
        made = {x: None if self._driver(x) else recipe(x) for x in self.want}
        there = self.own.outputs
        return {x: r if r and all(n in there for n in r[0]) else None for x, r in made.items()}

    @cached_property
    def result(self) -> SimulationResult[Any]:
        """What the chart says."""
        own = self.own
        want = [n for recipe in self.recipes.values() if recipe for n in recipe[0]]
        want += [own.of_driver(d, "acceleration") for d in own.drivers]
        how = {key: x for key, x in self.settings.items() if key != "static"}
        names = dict.fromkeys(want)
        return result_in_chart(own, self.leg.motion, self.t, names, engine=self.engine, **how)

    def read(self, name: str) -> Any:
        """Values (n,) of one of the user's outputs."""
        if (recipe := self.recipes[name]) is not None:
            names, made = recipe
            return made(*(self.result[n] for n in names))
        driver = self._driver(name)
        unknown = complex(np.nan, np.nan) if self.of.outputs[name].kind == "vector" else np.nan
        return unknown if driver is None else self._of_driver(*driver)

    def _driver(self, name: str) -> tuple[int, str] | None:
        """The user's driver and what of it an output is, if it is of one."""
        head, _, what = name.rpartition(".")
        heads = [self.of.of_driver(d, "q")[:-2] for d in self.of.drivers]
        return (heads.index(head), what) if head in heads else None

    def _of_driver(self, i: int, what: str) -> Any:
        """What is of a driver that does not lead."""
        n, own = len(self.at), self.own
        if what in IDLE:
            return 0.0
        if what in ("q", "rate"):
            return self.leg.state(self.t)[what == "rate"].reshape(n, -1)[:, i]
        if what != "acceleration":
            return np.nan
        qdd = np.array([self.result[own.of_driver(d, what)] for d in own.drivers]).T
        q, qd = (x.reshape(n, -1) for x in self.leg.motion.at(self.t))
        counted = self.leg.counted
        assert counted is not None
        rows = (counted.pairs.state(*both)[1:] for both in zip(q, qd, strict=True))
        return np.array([R[i] @ a + drift[i] for (R, drift), a in zip(rows, qdd, strict=True)])


class ChartedResult(SimulationResult[M]):
    """The result of a simulation over several charts.

    Outputs that are of a formation sequence alone, such as an inertia reduced to a driver, are NaN
    where another one leads.
    """

    def __getstate__(self) -> dict[str, Any]:
        return {name: x for name, x in super().__getstate__().items() if name != "parts"}

    @cached_property
    def parts(self) -> list[LegOutputs]:
        """Legs that have samples, each with the result in its chart."""
        legs, t = self.motion.legs, np.asarray(self.samples.time)
        begins = [leg.motion.t_start for leg in legs]
        which = np.maximum(np.searchsorted(begins, t, "right") - 1, 0)
        more = self.plan.want, self.settings, self.engine
        return [
            LegOutputs(self._compiled, leg, at, t[at], *more)
            for i, leg in enumerate(legs)
            if (at := np.flatnonzero(which == i)).size
        ]

    def _make(self, name: str) -> Any:
        kind = self.output(name).kind
        if kind == "number":
            return FREE  # efficiencies, which all are by drives
        k = len(self.mechanism.drivers)
        shape = (self.n, k, k) if kind == "matrix" else (self.n,)
        whole: Any = np.full(shape, complex(np.nan, np.nan) if kind == "vector" else np.nan)
        for part in self.parts:
            whole[part.at] = part.read(name)
        return whole

    @cached_property
    def quality(self) -> Quality:
        """Status of each sample and flags, each by the chart that leads there."""
        status, blame, flags = [""] * self.n, dict[int, str](), list[Flag]()
        for part in self.parts:
            own, at = part.result.quality, part.at.tolist()
            for i, word in zip(at, own.status, strict=True):
                status[i] = word
            blame |= {at[i]: block for i, block in own.blame.items()}
            flags += [replace(flag, sample=at[flag.sample]) for flag in own.flags]
        return Quality(tuple(status), blame, {}, {}, {}, {}, tuple(flags))

    @property
    def digits_lost(self) -> tuple[Flag, ...]:
        """Those of the legs."""
        return tuple(
            replace(flag, sample=int(part.at[flag.sample]))
            for part in self.parts
            for flag in part.result.digits_lost
        )

    def surely_whole(self) -> bool:
        """A cheap sufficient test that every sample has an answer."""
        return all(part.result.surely_whole() for part in self.parts)

    def _again(self, mechanism: Any, want: Sequence[str], settings: Any = None) -> Any:
        t = np.asarray(self.samples.time)
        return _charted(mechanism, self.motion, t, want, self.engine, settings or self.settings)


def result_along(
    mechanism: Compiled,
    motion: Motion,
    t: Floats,
    want: Iterable[str] | str,
    friction: FrictionMethod | None = None,
    engine: str = "auto",
    chunk: int | None = None,
) -> SimulationResult[Any]:
    """The wanted outputs at times (n,) [s] of a motion, see `motion_outputs.result_in_chart`."""
    if not motion.legs:
        how = friction, engine, chunk
        return result_in_chart(mechanism, motion, t, want, *how)
    settings = settings_along(motion, friction) | STATIC
    return _charted(mechanism, motion, t, want, engine, settings)


def _charted(
    mechanism: Compiled, motion: Motion, t: Floats, want: Any, engine: str, settings: Any
) -> ChartedResult[Any]:
    how = friction_asked(settings["friction"])
    plan = mechanism.planned(want, how)
    q, qd = (x.reshape(len(t), -1).T for x in motion.at(t))
    given = {f"q_{i}": x for i, x in enumerate(q)} | {f"qd_{i}": x for i, x in enumerate(qd)}
    return ChartedResult(mechanism, plan, Samples(len(t), given, t), (), engine, settings, motion)
