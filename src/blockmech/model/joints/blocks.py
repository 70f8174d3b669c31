"""Blocks said again as links and joints: the same links in the same poses, joined alike.

Links keep the frames of their blocks, and pairs count as they do there, driven ones as drivers do:
a guide's place is where its block measures from, and a pin that counts from another direction than
its link's x axis has a datum, a link without mass that is welded to that link in this direction.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping
from functools import cached_property

from blockmech.ground.errors import refused
from blockmech.ground.plane import EPS, dot
from blockmech.ground.values import xy
from blockmech.model.joints.contents import COUPLINGS, FRAME, LOADS
from blockmech.model.naming import JointName, LinkName, Names
from blockmech.model.scene import PER_DRIVER
from blockmech.model.spots import Spot, guide_spots, marker_place, pin_spot
from blockmech.model.structure import COORDINATE, JointRef, LinkRef, MarkerRef, Structure
from blockmech.typing import Data, Record

Form = Data
COUPLED = ("driver", "driven")
OF_LINKS = ("mass", "inertia", "cm")
ORIGIN = [0.0, 0.0]
ROUNDED = 64 * EPS  # of a coordinate: what poses of some links one after the other are known to


class SaidByLinks:
    """Names and places of what a graph's form holds, in a pose.

    Attributes
    ----------
    links : link of the graph -> its name in the document, the fixed one among them
    joints : pair of the graph -> its name
    drivers : driver -> its name
    zeros : driven pair -> [rad or m] by how much its driver counts more than the pair would, from
        the x axes or places of its links; where it does
    """

    def __init__(
        self,
        form: Record,
        structure: Structure,
        poses: Mapping[LinkRef, tuple[complex, complex]],
        at: Mapping[str, float],
    ) -> None:
        """Blocks in a pose.

        Parameters
        ----------
        poses : link -> its origin [m] and x axis [-], the fixed one among them
        at : driver -> its coordinate [rad or m] there
        """
        self.form, self.s, self.poses = form, structure, poses
        several = {ref.block for ref in self.s.links if ref.link != ref.block}
        self.links = {
            ref: f"{ref.block}_{ref.link}" if ref.block in several else ref.block
            for ref in self.s.links
        }
        self.links[self.s.frame_link] = FRAME
        self.pairs = [JointRef(name, j) for name, b in self.s.blocks.items() for j in b.joints]
        names = [ref.name for ref in self.pairs]
        self.joints = {
            ref: ref.name if names.count(ref.name) == 1 else f"{ref.block}_{ref.name}"
            for ref in self.pairs
        }
        self.flipped = {ref for d, ref in self.s.driven.items() if self.s.coordinate(d).sign < 0}
        self.drivers = {driver: driver.replace(".", "_") for driver in self.s.driven}
        zeros = {ref: self._zero(ref, at[driver]) for driver, ref in self.s.driven.items()}
        self.zeros = {ref: zero for ref, zero in zeros.items() if zero}

    def document(self) -> Form:
        """The joint-based form. Raises `RequestError` for blocks that are neither."""
        form, scene = self.form, self.form.get("scene", {})
        with_links = {ref.block for ref in self.s.links}
        for name, raw in form["blocks"].items():
            if name not in with_links and not raw["type"].startswith((LOADS, COUPLINGS)):
                message = f"{raw['type']} has no place among links and joints"
                raise refused(name, message, "draw a mechanism without it")
        head = {key: form[key] for key in ("name", "title", "source", "notes") if key in form}
        called = self.drivers | {
            f"{ref}.{COORDINATE}": f"joint.{name}.{COORDINATE}" for ref, name in self.joints.items()
        }
        drive, *rest = (
            {called[stopped]: x for stopped, x in scene.get(part, {}).items()}
            for part in PER_DRIVER
        )
        coupled = [name for name in form["blocks"] if name in self.s.couplings]
        return {
            "format": "blockmech/joints",
            "version": form["version"],
            **head,
            "gravity": scene.get("gravity", [0.0, 0.0]),
            "links": dict(self._links()),
            "joints": dict(self._pairs()),
            "drivers": {
                self.drivers[d]: {"joint": self.joints[ref], **drive.get(self.drivers[d], {})}
                for d, ref in self.s.driven.items()
            },
            "couplings": {name: self._said(name, COUPLINGS) for name in coupled},
            "loads": dict(self._loads()),
            **{key: part for key, part in zip(PER_DRIVER[1:], rest, strict=True) if part},
        }

    def names(self) -> Names:
        """Where links and joints of the document are in the graph."""
        links = {
            name: LinkName(ref, MarkerRef(ref.block, ref.link, ref.link), 0.0)
            for ref, name in self.links.items()
            if name != FRAME
        }
        joints = dict[str, JointName]()
        for ref, name in self.joints.items():
            first, second = (self.links[x] for x in self._ends(ref))
            joints[name] = JointName(ref, ref in self.flipped, False, (), (first, second))
        loads, couplings = {x: (x,) for x in self.s.elements}, {x: x for x in self.s.couplings}
        return Names(links, joints, loads, couplings)

    def _ends(self, ref: JointRef) -> list[LinkRef]:
        """The links of a pair, in the order in which its coordinate counts as a driver's."""
        ends = [self.s.earlier_link(ref), self.s.later_link(ref)]
        return ends[::-1] if ref in self.flipped else ends

    def _zero(self, ref: JointRef, q: float) -> float:
        """By how much [rad or m] a driver's coordinate is more than its pair's; 0 by rounding."""
        ends = self._ends(ref)
        if self.s.joint(ref).rotary:
            first, second = (self.poses[link][1] for link in ends)
            zero = math.remainder(q - cmath.phase(second / first), math.tau)
            return zero if abs(zero) > ROUNDED * (1 + abs(q)) else 0.0
        point, guide, direction = self._guide(ref)
        at = {spot.link: self._in_world(spot) for spot in (guide, point)}
        first, second = (at[link] for link in ends)
        zero = q - dot(direction * self.poses[guide.link][1], second - first)
        return zero if abs(zero) > ROUNDED * (abs(first) + abs(second)) else 0.0

    def _guide(self, ref: JointRef) -> tuple[Spot, Spot, complex]:
        """See `guide_spots`; the guide's spot is that from which the block measures along it."""
        point, guide, direction = guide_spots(self.s, ref)
        if guide.link.block == ref.block:
            measured = self.s.blocks[ref.block].slider_place(ref.name, guide.link.link)
            along = dot(direction, measured - guide.at)
            guide = guide._replace(at=guide.at + along * direction)
        return point, guide, direction

    def _in_world(self, spot: Spot) -> complex:
        o, e = self.poses[spot.link]
        return o + e * spot.at

    def _raw(self, ref: LinkRef) -> Record:
        """What the form says of a link."""
        raw: Record = self.form["blocks"][ref.block]
        return raw if ref == self.s.frame_link else raw.get("links", {}).get(ref.link, {})

    @cached_property
    def centres(self) -> dict[str, MarkerRef]:
        """Couplings whose leading wheel or cam is fixed to a link -> its centre."""
        return {f.coupling: f.centre for f in self.s.followers.values() if f.leader is None}

    @cached_property
    def markers(self) -> dict[MarkerRef, str]:
        """Markers that are no pair's alone -> their names, which are none of joints."""
        joined = {*self.s.feeds.values()} - {*self.centres.values()}
        used, names = {*self.joints.values()}, dict[MarkerRef, str]()
        for ref, name in self.links.items():
            for marker in self._raw(ref).get("markers", {}):
                where = MarkerRef(ref.block, ref.link, marker)
                if where not in joined:
                    names[where] = marker if marker not in used else f"{name}_{marker}"
                    used.add(names[where])
        return names

    def _links(self) -> Iterator[tuple[str, Form]]:
        for ref, name in self.links.items():
            raw = self._raw(ref)
            data = {key: raw[key] for key in OF_LINKS if key in raw}
            refs = {m: MarkerRef(ref.block, ref.link, m) for m in raw.get("markers", {})}
            markers = {
                self.markers[where]: raw["markers"][marker]
                for marker, where in refs.items()
                if where in self.markers
            }
            o, e = self.poses[ref]
            pose = {} if name == FRAME else {"pose": [o.real, o.imag, cmath.phase(e)]}
            yield name, {**data, **pose, **({"markers": markers} if markers else {})}
        for pair, zero in self.zeros.items():
            if self.s.joint(pair).rotary:
                o, e = self.poses[self._ends(pair)[0]]
                yield self._datum(pair), {"pose": [o.real, o.imag, cmath.phase(e) - zero]}

    def _datum(self, ref: JointRef) -> str:
        """Name of the link from whose x axis a driven pin counts, welded to its first link."""
        return f"{self.links[self._ends(ref)[0]]}_{self.joints[ref]}_datum"

    def _pairs(self) -> Iterator[tuple[str, Form]]:
        for ref in self.pairs:
            both, zero = self._ends(ref), self.zeros.get(ref, 0.0)
            names = [self.links[x] for x in both]
            law = self.form["blocks"][ref.block].get("friction", {}).get(ref.name)
            if self.s.joint(ref).rotary:
                spot = pin_spot(self.s, ref)
                if spot is None:
                    raise refused(str(ref), "no marker says where it is", "draw it anew")
                z = self._in_world(spot)
                at = [(z - o) / e for o, e in (self.poses[link] for link in both)]
                if zero:
                    weld: Form = {"type": "weld", "links": [names[0], self._datum(ref)]}
                    yield self._datum(ref), {**weld, "at": [ORIGIN, ORIGIN], "angle": [-zero, 0.0]}
                    names[0], at[0] = self._datum(ref), at[0] * cmath.rect(1.0, zero)
                data: Form = {"type": "R", "links": names, "at": [*map(xy, at)]}
            else:
                point, guide, direction = self._guide(ref)
                axis, slider = direction * self.poses[guide.link][1], both.index(point.link)
                foot = guide.at + direction * (-zero if slider else zero)
                points = {guide.link: foot, point.link: point.at}
                data = {"type": "P", "links": names, "at": [xy(points[link]) for link in both]}
                data["angle"] = [cmath.phase(axis / self.poses[link][1]) for link in both]
                data["slider"] = slider
            yield self.joints[ref], {**data, **({"friction": law} if law else {})}

    def _said(self, name: str, prefix: str) -> Form:
        """A load or coupling, its drivers by their names in the document."""
        raw = self.form["blocks"][name]
        ends = {end: self.drivers.get(raw[end], raw[end]) for end in COUPLED if end in raw}
        if (centre := self.centres.get(name)) is not None:
            ends["driver"] = f"{self.links[centre.on]}.{self.markers[centre]}"
        return {**raw, "type": raw["type"].removeprefix(prefix), **ends}

    def _loads(self) -> Iterator[tuple[str, Form]]:
        for name, element in self.s.elements.items():
            markers = [self.s.holds[JointRef(name, terminal)] for terminal in element.terminals]
            names = [self.links[marker.on] for marker in markers]
            points = [xy(marker_place(self.s, marker)) for marker in markers]
            ends: Form = {"links": names, "at": points}
            if len(names) == 1:
                ends = {"link": names[0], "at": points[0]}
            if not any(terminal.kind == "point" for terminal in element.terminals.values()):
                del ends["at"]
            yield name, self._said(name, LOADS) | ends
