"""What is told about the modes of a mechanism: by group, by sample, with their arcs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from blockmech.errors import Problem, RequestError, close_match, listed
from blockmech.modes.arcs import GroupArc


@dataclass(frozen=True)
class GroupMode:
    """One mode of a group at one sample. Modes and arcs are numbered from 0.

    Attributes
    ----------
    links : link -> x [m], y [m], angle [rad] of its frame in ground axes
    margin : of the group [-]; of a triad that of its platform, see `TriadMode`
    sign : of the determinant: the branch of a dyad; 0 at a dead centre
    double : whether modes merge here
    chosen : whether it is the mode that the file has
    put : what to put into the file to have it: keys of the block, or of the document
    arc : number of the arc that it is on, if arcs were asked for
    reach : driver coordinates [rad or m] from which to which it exists about this sample;
        None if it goes round and round, or arcs were not asked for
    after_turn : number of the mode at this sample that it is after a turn of the driver;
        None if it ends before, or the driver was not followed over a turn
    residual : of a triad, the largest miss of a leg, relative to its size [-]
    """

    links: Mapping[str, tuple[float, float, float]]
    margin: float
    sign: int
    double: bool
    chosen: bool
    put: Mapping[str, Any]
    arc: int | None = None
    reach: tuple[float, float] | None = None
    after_turn: int | None = None
    residual: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """The mode as a JSON object."""
        found = {
            "links": {name: list(pose) for name, pose in self.links.items()},
            "margin": self.margin,
            "sign": self.sign,
            "double": self.double,
            "chosen": self.chosen,
            "put": dict(self.put),
            "arc": self.arc,
            "reach": None if self.reach is None else [_finite(q) for q in self.reach],
            "after_turn": self.after_turn,
        }
        return found if self.residual is None else found | {"residual": self.residual}


@dataclass(frozen=True)
class GroupModes:
    """The modes of one group: at each sample, and their arcs.

    Attributes
    ----------
    group : its name in messages
    kind : e.g. "II RRR", "III triad"
    samples : the modes at each sample; none where it or an earlier group cannot close
    arcs : along the driver
    note : what is not told, and why
    """

    group: str
    kind: str
    samples: tuple[tuple[GroupMode, ...], ...]
    arcs: tuple[GroupArc, ...] = ()
    note: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The modes as a JSON object."""
        return {
            "group": self.group,
            "kind": self.kind,
            "samples": [[m.to_dict() for m in modes] for modes in self.samples],
            "arcs": [arc.to_dict() for arc in self.arcs],
            "note": self.note,
        }


@dataclass(frozen=True)
class Modes:
    """The modes of a mechanism's groups.

    Attributes
    ----------
    drivers : driver -> its coordinate [rad or m] at each sample
    units : of their coordinates
    driver : the one along which the arcs are, or ""
    groups : in formation order
    """

    drivers: Mapping[str, tuple[float, ...]]
    units: Mapping[str, str]
    driver: str
    groups: tuple[GroupModes, ...]

    def __getitem__(self, group: str) -> GroupModes:
        """The modes of one group. Raises `RequestError` for an unknown name."""
        for found in self.groups:
            if found.group == group:
                return found
        names = [g.group for g in self.groups]
        raise RequestError(
            Problem(
                "bad-request",
                group,
                "there is no such group",
                f"groups: {listed(names)}",
                close_match(group, names),
            )
        )

    def text(self, degrees: bool = False) -> str:
        """The modes as lines of text."""
        from blockmech.modes.text import lines

        return "\n".join(lines(self, degrees))

    def __str__(self) -> str:
        return self.text()

    def to_dict(self) -> dict[str, Any]:
        """The modes as a JSON object."""
        return {
            "drivers": {name: list(row) for name, row in self.drivers.items()},
            "units": dict(self.units),
            "driver": self.driver,
            "groups": [group.to_dict() for group in self.groups],
        }


def _finite(q: float) -> float | None:
    return q if math.isfinite(q) else None
