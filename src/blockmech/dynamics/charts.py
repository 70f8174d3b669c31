"""Charts: any joint may be the coordinate of a motion.

The class of a mechanism depends on its driving link, and each choice of driving joints gives
another formation sequence: a chart of the configuration space. Where the coordinates of one stand
still though the mechanism moves, another one goes on. With the rates of all joints

    T (joints, k)

by those of the joints that lead, joints whose rows of T span the largest volume move most: pivoted
Gram-Schmidt picks them, those of drivers that must stay first. A joint between moving links counts
a fifth, because it makes general groups. The state is handed over through the poses of links and
the rates of joints.

Source: Wehage & Haug, Generalized coordinate partitioning for dimension reduction in analysis of
constrained dynamic systems, J. Mech. Design 104, 1982.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np

from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.modes import TwoModes
from blockmech.dynamics.contacts import SETTLED
from blockmech.dynamics.pair_stops import Counted, PairStops, stopped_pairs
from blockmech.dynamics.request import Pairs, Start
from blockmech.dynamics.system import run_cache
from blockmech.ground.errors import GraphError
from blockmech.ground.names import free_name
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import BLUR
from blockmech.ground.values import Marker
from blockmech.model.graph import Graph
from blockmech.model.joints.blocks import SaidByLinks
from blockmech.model.joints.closing import Closing
from blockmech.model.joints.contents import FRAME, DriverGiven, LinkGiven, coordinate_of
from blockmech.model.joints.decompose import decompose
from blockmech.model.joints.layout import Layout, Pose, Poses
from blockmech.model.joints.linkage import Linkage
from blockmech.model.naming import LinkName, Names
from blockmech.model.scene import Initial
from blockmech.model.spots import marker_place
from blockmech.model.structure import COORDINATE, MarkerRef, Structure
from blockmech.outputs.sensors_by_link import with_sensors_of_blocks
from blockmech.result.motion import Motion
from blockmech.typing import Floats, Real

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

BETTER = 2.0  # times the volume that other joints must span for a chart to be left
CHANGE = EPS**0.25  # of the largest singular value: below, the pairs' conditions lose rank
FLOATING = 0.2  # what a joint between moving links counts


@dataclass(frozen=True)
class Chart:
    """A formation sequence of a document: the joints of its drivers are the coordinates.

    Attributes
    ----------
    mechanism : compiled, with the names of the document
    joints : those that lead, in the order of the drivers
    home : the document of the user, whose drivers may be others
    users : joint -> the user's driver
    names : where links and joints of the document are in the blocks of the user
    cache : charts of the document that there are already, by their blocks and end stops
    """

    mechanism: Compiled
    joints: tuple[str, ...]
    home: Linkage
    users: Mapping[str, str]
    names: Names
    cache: dict[str, Chart]

    @cached_property
    def layout(self) -> Layout:
        """Links and pairs."""
        return Layout.of(self.home)

    @cached_property
    def weights(self) -> dict[str, float]:
        """Pairs that may lead, and what the rate of each counts."""
        return {
            name: (1.0 if FRAME in c.links else FLOATING)
            / (1.0 if c.kind == "R" else self.layout.size)
            for name, c in self.layout.pairs.items()
            if name in self.home.joints  # of a pin of three links it is not said which two
        }

    @cached_property
    def is_general(self) -> bool:
        """Whether a group has no closed form: its poses are dear, and known near its home."""
        return any(isinstance(x, GeneralGroup) for x in self.mechanism.structure.blocks.values())

    def in_outputs(self, link: str = "", joint: str = "") -> str:
        """What names of outputs of a link or joint begin with."""
        if self.mechanism.names is not None:
            return f"link.{link}" if link else f"joint.{joint}"
        return str(self.names.links[link].link if link else self.names.joints[joint].joint)

    def output_names(self, joints: Sequence[str]) -> tuple[str, ...]:
        """Joints in the words of outputs."""
        return tuple(self.in_outputs(joint=j).removeprefix("joint.") for j in joints)

    def poses(self, q: Floats) -> Poses:
        """Poses of all links at coordinates (k,)."""
        links, at = self.layout.links, dict(zip(self.mechanism.drivers, q.tolist(), strict=True))
        heads = [self.in_outputs(link) for link in links]
        want = [f"{head}.{quantity}" for head in heads for quantity in ("p", "angle")]
        still = dict.fromkeys(at, 0.0)
        result = self.mechanism.run(at, rates=still, want=want, friction="none", on_gap="mark")
        rows = ((complex(result[f"{x}.p"][0]), float(result[f"{x}.angle"][0])) for x in heads)
        return {FRAME: Pose(), **{x: Pose(*row) for x, row in zip(links, rows, strict=True)}}

    def singular_values(self, poses: Poses, locked: Collection[str]) -> Floats:
        """Those of the conditions of all pairs, and of coordinates that are held, falling."""
        of, pairs = self.layout, tuple(self.layout.pairs.values())
        rows = Closing(of.links, pairs, of.size, dict.fromkeys(locked, 0.0)).conditions(poses)[1]
        return np.asarray(np.linalg.svd(rows, compute_uv=False))

    @cached_property
    def may_lead(self) -> PairStops:
        """Coordinates of all joints that may lead."""
        return self.pairs([*self.weights])

    def tangent(self, q: Floats) -> Floats:
        """Rates (joints, k) of joints that may lead, as they count, by those that do."""
        return np.array([*self.weights.values()])[:, None] * self.may_lead.state(q, 0 * q)[1]

    def volume(self, T: Floats, joints: Sequence[str]) -> float:
        """What some joints span of all motions, as they count."""
        names = list(self.weights)
        return abs(float(np.linalg.det(T[[names.index(joint) for joint in joints]])))

    def largest(self, T: Floats, fixed: Sequence[str], without: Collection[str]) -> Sequence[str]:
        """The joints that span most, those that are fixed among them; ``without`` some."""
        names, joints, remainder = list(self.weights), list[str](), T.copy()
        remainder[[name in without for name in names]] = 0.0
        for n in range(T.shape[1]):
            sizes = np.linalg.norm(remainder, axis=1)
            i = names.index(fixed[n]) if n < len(fixed) else int(sizes.argmax())
            joints.append(names[i])
            remainder -= np.outer(remainder @ remainder[i], remainder[i]) / (sizes[i] ** 2 or 1.0)
        return joints

    def better(self, T: Floats, fixed: Sequence[str] = ()) -> bool:
        """Whether others should lead where all joints have some rates."""
        best = self.largest(T, fixed, ()) if np.isfinite(T).all() else self.joints
        return self.volume(T, best) > BETTER * self.volume(T, self.joints)

    def successor(
        self, q: Floats, fixed: Sequence[str], states: Callable[[Sequence[str]], Pairs]
    ) -> tuple[Chart, Pairs] | None:
        """The chart that leads better at coordinates (k,), of which ``states`` tells its start."""
        T, poses, without = self.tangent(q), self.poses(q), set[str]()
        threshold = BETTER * self.volume(T, self.joints)
        while self.volume(T, joints := self.largest(T, fixed, without)) > threshold:
            starts = states(joints)
            try:
                chart = self.led_by(starts, poses)
                if self.alike(poses, chart.poses(np.array([starts[x][0] for x in chart.joints]))):
                    return chart, starts
            except GraphError:  # where poses tell no mode, or nothing follows from these joints
                pass
            without.add(joints[-1])
        return None

    def alike(self, first: Poses, second: Poses) -> bool:
        """Whether two poses are one, to what rounding and a root leave."""
        return all(
            abs(first[link].o - second[link].o) <= BLUR * self.layout.size
            and abs(cmath.exp(1j * (first[link].theta - second[link].theta)) - 1) <= BLUR
            for link in first
        )

    def states(self, q: Floats, qd: Floats) -> dict[str, tuple[float, float]]:
        """Joint -> coordinate [rad or m] and rate, of all that may lead."""
        coordinates, rows, _ = self.may_lead.state(q, 0 * q)
        values = zip(coordinates.tolist(), (rows @ qd).tolist(), strict=True)
        leading = zip(self.joints, zip(q.tolist(), qd.tolist(), strict=True), strict=True)
        return dict(zip(self.weights, values, strict=True)) | dict(leading)

    @property
    def drivers(self) -> tuple[str, ...]:
        """Drivers, those of the user by their own names."""
        pairs = zip(self.joints, self.mechanism.drivers, strict=True)
        return tuple(self.users.get(joint, driver) for joint, driver in pairs)

    def pairs(self, joints: Sequence[str]) -> PairStops:
        """Coordinates of some joints, and how they change."""
        names = [f"{self.in_outputs(joint=joint)}.{COORDINATE}" for joint in joints]
        return stopped_pairs(self.mechanism, names)

    def counted(self, q: Real, users: Floats) -> Counted | None:
        """Coordinates of the user's drivers, which are so much where it begins.

        None where these lead, and count from where their joints do.
        """
        joints, at = tuple(self.users), np.array(np.atleast_1d(q), dtype=np.float64)
        if self.joints == joints and (np.abs(users - at) < SETTLED).all():
            return None
        return Counted(self.pairs(joints), at, users)

    def following(self, motion: Motion, start: Start) -> Chart | None:
        """The same chart, its dyads following a motion that ended at a change point.

        There the conditions of the pairs lose rank. None where they do not.
        """
        poses = self.poses(np.atleast_1d(motion.q_end))
        if all(math.isfinite(pose.theta) for pose in poses.values()):
            singular_values = self.singular_values(poses, ())
            if singular_values[-1] > CHANGE * singular_values[0]:
                return None
        document = self.mechanism.document
        if isinstance(document, Graph):
            data, names = document.flat().to_data(), self.mechanism.names
        else:
            data, names, *_ = decompose(self.home)
        driver, blocks = self.mechanism.drivers[0], self.mechanism.structure.blocks
        for name, block in blocks.items():
            branch = getattr(block, "branch", None)
            if isinstance(block, TwoModes) and branch in (-1, 1):
                home = {"drivers": {driver: float(start.q)}, "branch": branch}
                data["blocks"][name] |= {"branch": "follow", "home": home}
        mechanism = type(self.mechanism)._from_graph(Graph.from_data(data), names, document)
        return replace(self, mechanism=mechanism) if mechanism.structure.followed else None

    def led_by(self, starts: Pairs, poses: Poses) -> Chart:
        """The chart that some joints lead: joint -> (coordinate, rate), in these poses.

        Joints that a user drives keep their drivers. Raises `GraphError` where the poses tell no
        assembly mode.
        """
        linkage = self.home
        used_names = {*linkage.drivers, *linkage.links, *linkage.loads, *linkage.signals}
        names = {joint: free_name(joint, used_names) for joint in starts} | linkage.driven
        stopped = {d: x.joint for d, x in linkage.drivers.items()}
        copy = linkage.snapshot()
        copy.links = linkage.links | {
            name: linkage.links[name].model_copy(update={"pose": _pose(pose)})
            for name, pose in poses.items()
            if name != FRAME
        }
        copy.drivers = {
            names[joint]: linkage.drivers.get(names[joint]) or DriverGiven(joint=joint)
            for joint in starts
        }
        copy.drivers |= {c.driven: linkage.drivers[c.driven] for c in linkage.couplings.values()}
        copy.initial = {names[j]: Initial(q=q, rate=rate) for j, (q, rate) in starts.items()}
        copy.stops = {}
        for name, stop in linkage.stops.items():
            joint = stopped.get(name) or coordinate_of(name) or name
            leads = names[joint] if joint in starts else f"joint.{joint}.{COORDINATE}"
            copy.stops[leads] = stop
        copy.motion = {d: role for d, role in linkage.motion.items() if d in copy.drivers}
        data, named, _, document = decompose(copy)
        if copy.wires:
            data = with_sensors_of_blocks(data, named)
        key = repr((data["blocks"], copy.stops))  # homes of general groups, too, so those are new
        if key not in self.cache:
            mechanism = type(self.mechanism)._from_graph(Graph.from_data(data), named, document)
            joints = tuple(copy.drivers[d].joint for d in mechanism.drivers)
            chart = replace(self, mechanism=mechanism, joints=joints)
            if chart.is_general:
                return chart
            self.cache[key] = chart
        return self.cache[key]


def _pose(pose: Pose) -> tuple[float, float, float]:
    return pose.o.real, pose.o.imag, pose.theta


# -- the user's ----------------------------------------------------------------------------


def home_chart(mechanism: Compiled, q: Floats) -> Chart:
    """The user's chart: of blocks with the document that says them as links and joints.

    Raises `BlockmechError` where links and joints do not say them.
    """
    linkage, names, s = mechanism.document, mechanism.names, mechanism.structure
    if isinstance(linkage, Linkage):
        joints = [linkage.drivers[d].joint for d in mechanism.drivers]
    else:
        links = [link for link in s.links if link != s.frame_link]
        want = [f"{link}.{quantity}" for link in links for quantity in ("p", "angle")]
        want += [f"{driver}.q" for driver in s.driven]
        at = dict(zip(mechanism.drivers, q.tolist(), strict=True))
        result = mechanism.run(at, rates=dict.fromkeys(at, 0.0), want=want, friction="none")
        poses = {
            x: (complex(result[f"{x}.p"][0]), cmath.rect(1.0, result[f"{x}.angle"][0]))
            for x in links
        } | {s.frame_link: (0j, 1 + 0j)}
        coordinates = {driver: float(result[f"{driver}.q"][0]) for driver in s.driven}
        as_links = SaidByLinks(cast("Graph", linkage).flat().to_data(), s, poses, coordinates)
        linkage, names = Linkage.from_data(as_links.document()), as_links.names()
        joints = [as_links.joints[s.driven[d]] for d in mechanism.drivers]
    users = dict(zip(joints, mechanism.drivers, strict=True))
    home, names = _marked(linkage, cast("Names", names), s)
    cache = mechanism._once(run_cache).setdefault("charts", {})
    return Chart(mechanism, tuple(joints), home, users, names, cache)


def _marked(linkage: Linkage, names: Names, s: Structure) -> tuple[Linkage, Names]:
    """A document with all markers of the blocks, and where these are."""
    copy, fixed = linkage.snapshot(), MarkerRef(s.frame, s.frame_link.link, "")
    links = {FRAME: LinkName(s.frame_link, fixed, 0.0), **names.links}
    of_links = {where.link: name for name, where in links.items()}
    for marker in (m for block in (s.frame, *s.blocks) for m in s.markers(block)):
        name = of_links[marker.on]
        where, link = links[name], copy.links.get(name) or LinkGiven()
        called = free_name(f"{marker.block}_{marker.name}", link.markers)
        at = marker_place(s, marker)
        if name != FRAME:
            at = (at - marker_place(s, where.marker)) * cmath.rect(1.0, -where.turn)
        markers = {**link.markers, called: Marker(at=(at.real, at.imag))}
        copy.links[name] = link.model_copy(update={"markers": markers})
        links[name] = replace(where, markers={**where.markers, called: marker})
    return copy, replace(names, links=links)
