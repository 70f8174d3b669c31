r"""Roles of the drivers in a motion: free, prescribed by a law of motion, or locked at a place.

A driver c that is not free is a constraint of the drivers' coordinates that holds in both senses,

    M q'' = push + sum of stops and friction + e_c D_c,        q''_c = a_c(t)

with a_c from its law, 0 where it is locked, and D_c what its drive gives. So it stands beside the
stops that something lies against (`contacts.Constraints`): the free drivers take

    M_ff q''_f = push_f - M_fc a_c

and D_c is what is left over of the full equation. Where a change of roles stops or takes along a
driver at once, the rates of the others jump by M_ff dq'_f = -M_fc dq'_c: an impact of its drive.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from blockmech.dynamics.contacts import INSTANT, Constraints
from blockmech.ground.errors import among, listed, refused
from blockmech.ground.units import number_in_si
from blockmech.model.laws_of_motion import LawOfMotion
from blockmech.model.scene import Locked, Role, Scene
from blockmech.typing import Floats, Real

FREE, PRESCRIBED, LOCKED = "free", "prescribed", "locked"
ROLES = (FREE, PRESCRIBED, LOCKED)
RolesGiven: TypeAlias = Mapping[str, str | float]
"""Driver -> its role, or the coordinate [rad or m] at which it is locked."""


@dataclass(frozen=True)
class Roles:
    """What each driver does from an instant on.

    drivers : names (k,)
    of : role of each
    laws : law of motion of each that has one
    """

    drivers: tuple[str, ...]
    of: tuple[str, ...]
    laws: tuple[LawOfMotion | None, ...]

    @cached_property
    def bound(self) -> list[int]:
        """Drivers that are not free."""
        return [i for i, role in enumerate(self.of) if role != FREE]

    @cached_property
    def prescribed(self) -> list[int]:
        """Those of them that follow their laws."""
        return [i for i, role in enumerate(self.of) if role == PRESCRIBED]

    def by_driver(self) -> dict[str, str]:
        """Driver -> role."""
        return dict(zip(self.drivers, self.of, strict=True))

    def but(self, changed: Mapping[str, str]) -> Roles:
        """The same with some roles changed."""
        return replace(self, of=tuple((self.by_driver() | dict(changed)).values()))

    def among(self, drivers: Sequence[str]) -> Roles:
        """The same among other drivers, of which those that are not known are free."""
        of, laws = self.by_driver(), dict(zip(self.drivers, self.laws, strict=True))
        roles = tuple(of.get(d, FREE) for d in drivers)
        return Roles(tuple(drivers), roles, tuple(laws.get(d) for d in drivers))

    def law_at(self, i: int, t: Real) -> tuple[Real, ...]:
        """Coordinate, rate and acceleration of a driver by its law, at a time or at some [s]."""
        law = self.laws[i]
        assert law is not None
        values = law.at_times(np.atleast_1d(np.asarray(t, dtype=np.float64)))
        return values if np.ndim(t) else tuple(float(x[0]) for x in values)

    def motion(self, q: Floats, rate: Floats, t: Real) -> tuple[Floats, Floats]:
        """Coordinates and rates (..., k) at times, those of laws as the laws say."""
        if self.prescribed:
            q, rate = q.copy(), rate.copy()
            for i in self.prescribed:
                q[..., i], rate[..., i], _ = self.law_at(i, t)
        return q, rate

    def constraint(self, t: Real, lead: float = 0.0) -> Constraints:
        """The drivers that are not free, at a time or at some (n,) [s], as something held.

        ``lead`` [s] is looked where a law neither moves nor pushes yet: to where it begins to.
        """
        k, n = len(self.drivers), np.shape(t)
        rows = np.broadcast_to(np.eye(k)[self.bound], (*n, len(self.bound), k))
        pull, speeds = (np.zeros((*n, len(self.bound))) for _ in range(2))
        for at, i in enumerate(self.bound):
            if i in self.prescribed:
                _, speeds[..., at], pull[..., at] = self.law_at(i, t)
                if lead and not speeds[at] and not pull[at]:
                    pull[at] = self.law_at(i, t + lead)[2]
        return Constraints(rows, -pull, ((-1, 1),) * len(self.bound), speeds)

    def extend(self, stops: Constraints | None, t: Real, lead: float = 0.0) -> Constraints | None:
        """Stops that something lies against, and behind them the drivers that are not free."""
        if not self.bound:
            return stops
        bound = self.constraint(t, lead)
        return bound if stops is None else stops.extended(bound)

    @cached_property
    def kinks(self) -> Floats:
        """Times [s], rising, at which laws have kinks or end."""
        return np.unique([x for i in self.prescribed for x in self.laws[i].kinks])  # type: ignore[union-attr]

    def turns(self, t: float) -> bool:
        """Whether a law has a kink at a time [s], and no rate there: it begins or ends to move."""
        i = np.searchsorted(self.kinks, t)
        at_kink = bool(i < self.kinks.size and self.kinks[i] == t)
        return at_kink and any(self.law_at(j, t)[1] == 0.0 for j in self.prescribed)

    def over(self, t: float) -> bool:
        """Whether a law says nothing after a time [s]."""
        at_kink = self.kinks.size > 0 and t >= self.kinks[-1]
        return at_kink and any(math.isnan(self.law_at(i, t + INSTANT)[0]) for i in self.prescribed)

    def next_kink(self, t: float) -> float:
        """The first time [s] after one at which a law has a kink, or ends."""
        i = np.searchsorted(self.kinks, t, "right")
        return float(self.kinks[i]) if i < self.kinks.size else math.inf


# -- what a user gives ---------------------------------------------------------------------


def roles_of(
    scene: Scene,
    drivers: Mapping[str, str],
    requested: RolesGiven | None,
    changes: Mapping[str, Mapping[str, str]],
    last: float,
) -> tuple[Roles | None, dict[str, tuple[float, float]]]:
    """The roles at the start, None where all are free at all times; and starts that they say.

    ``drivers`` : unit of each driver's coordinate
    ``requested`` : those of a call, in place of the scene's
    ``changes`` : event -> driver -> role; ``last`` : time [s] to which laws must reach

    Raises `RequestError` for roles that cannot be.
    """
    choices = scene.motion if requested is None else _read_roles(requested, drivers)
    of = {d: LOCKED if isinstance(role, Locked) else role for d, role in choices.items()}
    where = scene.address("motion", "") if requested is None else "roles."
    wishes = [(d, role, f"{where}{d}") for d, role in of.items()]
    for name, then in changes.items():
        where = f"watch.{name}.then"
        wishes += [(d, role, f"{where}.{d}") for d, role in _by_driver(then, where, drivers)]
    for driver, role, where in wishes:
        _check_role(scene, drivers, driver, role, where, last)
    if all(role == FREE for _, role, _ in wishes):
        return None, {}
    laws = tuple(scene.drive.get(d) for d in drivers)
    roles = Roles(tuple(drivers), tuple(of.get(d, FREE) for d in drivers), laws)
    starts = {d: (role.locked, 0.0) for d, role in choices.items() if isinstance(role, Locked)}
    starts |= {roles.drivers[i]: roles.law_at(i, 0.0)[:2] for i in roles.prescribed}
    return roles, starts


def located(requested: RolesGiven | None) -> list[str]:
    """Drivers that a call locks at a coordinate."""
    return [driver for driver, role in (requested or {}).items() if not _is_word(role)]


def _is_word(role: object) -> bool:
    """Whether a role is given by a word, not by a coordinate such as 0.3 or "30deg"."""
    return isinstance(role, str) and role[:1].isalpha()


def _read_roles(requested: Any, units: Mapping[str, str]) -> dict[str, Role]:
    """Driver -> role, where a coordinate [rad or m] is that at which the driver is locked."""
    roles: dict[str, Role] = {}
    for driver, role in _by_driver(requested, "roles", units):
        if _is_word(role):
            roles[driver] = role
            continue
        coordinate = number_in_si(role, units.get(driver, ""))
        if not math.isfinite(coordinate):
            fault, remedy = f"{role!r} is no coordinate", "give a number [rad or m]"
            raise refused(f"roles.{driver}", fault, remedy)
        roles[driver] = Locked(locked=coordinate)
    return roles


def _by_driver(roles: Any, where: str, drivers: Iterable[str]) -> Collection[tuple[str, Any]]:
    """Drivers with their roles. Raises `RequestError` where these are given without names."""
    if not isinstance(roles, Mapping):
        remedy = f"give each its role, like {dict.fromkeys([*drivers][:1], LOCKED)!r}"
        raise refused(where, f"{roles!r} names no drivers", remedy)
    return roles.items()


def _check_role(
    scene: Scene, drivers: Mapping[str, str], driver: str, role: str, where: str, last: float
) -> None:
    """Refuse a role that a driver cannot have."""
    among(drivers, "driver", driver, "unknown-driver", where)
    among(ROLES, "role", role, "roles", where)
    if role != PRESCRIBED:
        return
    law = scene.drive.get(driver)
    if law is None:
        remedy = f"give it one in {scene.address('drive', driver)}, or lock it"
        raise refused(where, f"{driver} has no law of motion", remedy, code="no-law")
    if law.corners:
        fault = f"the rate of the law of {driver} jumps at {law.corners[0]:.9g} s"
        remedy = 'an endless force would be needed: let the table be "cubic"'
        raise refused(where, fault, remedy, code="roles")
    first = float(law.at_times(np.zeros(1))[0][0])
    ends = law.begin() + law.duration()
    if math.isnan(first) or (
        math.isfinite(last) and math.isnan(float(law.at_times(np.array([last]))[0][0]))
    ):
        fault = f"the law of {driver} says nothing "
        fault += f"at {0.0 if math.isnan(first) else last:.9g} s: it is one from "
        fault += f"{law.begin():.9g} to {ends:.9g} s"
        raise refused(where, fault, "ask for a shorter time, or give a longer law", code="roles")


def unused_laws(scene: Scene, drivers: Sequence[str], roles: Sequence[Mapping[str, str]]) -> str:
    """A note on laws of motion that a motion does not use; empty where it uses all."""
    used = {d for of in roles for d, role in of.items() if role == PRESCRIBED}
    unused = [d for d in drivers if d in scene.drive and d not in used]
    if not unused:
        return ""
    whose = f"the law of motion of {listed(unused)} is not used: "
    if len(drivers) == 1:
        return f"{whose}the loads alone move it"
    return f"{whose}roles={dict.fromkeys(unused, PRESCRIBED)!r} lets the motion follow it"
