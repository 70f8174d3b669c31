"""Blocks said again as links and joints, so that a diagram can be drawn on.

Links stand where they are in the pose that is farthest from all dead centres, which fixes the
assembly modes; pairs lie between the same links, at the same places. The document that is made is
run and compared with the blocks: what links and joints do not say alike is refused.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from blockmech.builders import Linkage
from blockmech.draw.motion import Motion, marker_place
from blockmech.draw.sketch import pin_spot, sketch_of
from blockmech.errors import BlockmechError, RequestError, refused
from blockmech.model.joints.contents import COUPLINGS, FRAME, LOADS
from blockmech.model.structure import JointRef, LinkRef, MarkerRef
from blockmech.studio.edits import OF_DRIVERS
from blockmech.values import xy

Form = dict[str, Any]
COUPLED = ("driver", "driven")
OF_LINKS = ("mass", "inertia", "cm")
COMPARED = 3  # poses
SAME = 1e-9  # of the size: poses are found by other formulas


class _Redrawn:
    """Names and places of what a graph's form holds, in a pose far from dead centres."""

    def __init__(self, form: Mapping[str, Any], motion: Motion) -> None:
        self.form, self.motion, self.s = form, motion, motion.structure
        self.k = motion.clearest
        several = {ref.block for ref in self.s.links if ref.link != ref.block}
        self.links = {
            ref: f"{ref.block}_{ref.link}" if ref.block in several else ref.block
            for ref in self.s.links
        }
        self.links[self.s.frame_link] = FRAME
        self.pairs = [JointRef(name, j) for name, b in self.s.blocks.items() for j in b.joints]
        words = [ref.name for ref in self.pairs]
        self.joints = {
            ref: ref.name if words.count(ref.name) == 1 else f"{ref.block}_{ref.name}"
            for ref in self.pairs
        }
        self.drivers = {driver: driver.replace(".", "_") for driver in self.s.driven}

    def document(self) -> Form:
        """The joint-based form. Raises `RequestError` for blocks that are neither."""
        form, scene = self.form, self.form.get("scene", {})
        known = {ref.block for ref in self.s.links}
        for name, raw in form["blocks"].items():
            if name not in known and not raw["type"].startswith((LOADS, COUPLINGS)):
                found = f"{raw['type']} has no place among links and joints"
                raise refused(name, found, "draw a mechanism without it")
        head = {key: form[key] for key in ("name", "title", "source", "notes") if key in form}
        drive, *rest = (
            {self.drivers[driver]: x for driver, x in scene.get(part, {}).items()}
            for part in OF_DRIVERS
        )
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
            "couplings": dict(self._couplings()),
            "loads": dict(self._loads()),
            **{key: part for key, part in zip(OF_DRIVERS[1:], rest, strict=True) if part},
        }

    def _pose(self, link: LinkRef) -> tuple[complex, complex]:
        return complex(self.motion.origin[link][self.k]), complex(self.motion.axis[link][self.k])

    def _on(self, link: LinkRef, z: complex) -> list[float]:
        o, e = self._pose(link)
        return xy((z - o) / e)

    def _links(self) -> Iterator[tuple[str, Form]]:
        taken = {*self.joints.values()}
        joined = {*self.s.feeds.values()}
        for ref, name in self.links.items():
            raw = self.form["blocks"][ref.block]
            own = raw if name == FRAME else raw.get("links", {}).get(ref.link, {})
            made = {key: own[key] for key in OF_LINKS if key in own}
            markers = {}
            for marker, given in own.get("markers", {}).items():
                if MarkerRef(ref.block, ref.link, marker) not in joined:
                    called = marker if marker not in taken else f"{name}_{marker}"
                    markers[called] = given
                    taken.add(called)
            o, e = self._pose(ref)
            pose = {} if name == FRAME else {"pose": [o.real, o.imag, cmath.phase(e)]}
            yield name, {**made, **pose, **({"markers": markers} if markers else {})}

    def _pairs(self) -> Iterator[tuple[str, Form]]:
        sliders = iter(sketch_of(self.motion).sliders)
        for ref in self.pairs:
            both = [self.s.earlier_link(ref), self.s.later_link(ref)]
            law = self.form["blocks"][ref.block].get("friction", {}).get(ref.name)
            made: Form = {"type": self.s.joint(ref).kind, "links": [self.links[x] for x in both]}
            if made["type"] == "R":
                spot = pin_spot(self.s, ref)
                if spot is None:
                    raise refused(str(ref), "no marker says where it is", "draw it anew")
                z = complex(self.motion.at(*spot)[self.k])
                made["at"] = [self._on(link, z) for link in both]
            else:
                slider = next(sliders)
                along = slider.direction * self._pose(slider.guide.link)[1]
                places = {s.link: xy(s.at) for s in (slider.guide, slider.point)}
                made["at"] = [places[link] for link in both]
                made["angle"] = [cmath.phase(along / self._pose(link)[1]) for link in both]
                made["slider"] = both.index(slider.point.link)
            yield self.joints[ref], {**made, **({"friction": law} if law else {})}

    def _couplings(self) -> Iterator[tuple[str, Form]]:
        for name, raw in self.form["blocks"].items():
            if raw["type"].startswith(COUPLINGS):
                ends = {end: self.drivers.get(raw[end], raw[end]) for end in COUPLED}
                yield name, {**raw, "type": raw["type"].removeprefix(COUPLINGS), **ends}

    def _loads(self) -> Iterator[tuple[str, Form]]:
        for name, element in self.s.elements.items():
            raw = self.form["blocks"][name]
            held = [self.s.holds[JointRef(name, terminal)] for terminal in element.terminals]
            names = [self.links[marker.on] for marker in held]
            places = [xy(marker_place(self.s, marker)) for marker in held]
            made = {**raw, "type": raw["type"].removeprefix(LOADS)}
            if "driver" in raw:
                made["driver"] = self.drivers[raw["driver"]]
            points = [kind.kind == "point" for kind in element.terminals.values()]
            if len(names) == 1:
                made |= {"link": names[0], **({"at": places[0]} if points[0] else {})}
            else:
                made |= {"links": names, **({"at": places} if any(points) else {})}
            yield name, made


def as_links(form: Mapping[str, Any], motion: Motion) -> Form:
    """A graph's form as links and joints.

    Raises `RequestError` where these do not say the same, with the reason.
    """
    redrawn = _Redrawn(form, motion)
    made = redrawn.document()
    try:
        other = Linkage.from_data(made)
        if problems := other.check():
            raise RequestError(*problems)
        _compare(redrawn, other.compile())
    except BlockmechError as error:
        why = f"links and joints do not say the same: {error}"
        raise refused("blocks", why, "draw the mechanism anew") from None
    data: Form = other.to_data()
    return data


def _compare(redrawn: _Redrawn, other: Any) -> None:
    """Raises `RequestError` where a link of the other mechanism stands elsewhere."""
    motion = redrawn.motion
    rows = np.flatnonzero(motion.feasible)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, COMPARED).astype(int))]
    at = {redrawn.drivers[d]: q[rows] for d, q in motion.q.items()}
    want = [f"link.{name}.p" for name in redrawn.links.values() if name != FRAME]
    result = other.run(at=at, rates=dict.fromkeys(at, 0.0), want=want, friction="none")
    size = max(float(np.nanmax(np.abs(z))) for z in motion.origin.values()) or 1.0
    for link, name in redrawn.links.items():
        if name != FRAME:
            off = np.abs(result[f"link.{name}.p"] - motion.origin[link][rows]).max()
            if not off <= SAME * size:
                where = f"{name} would stand {off:.3g} m elsewhere"
                raise refused(name, where, "look at the coordinates of the drivers")
