"""A block on trial: random motions of its joints, its kernels, and a mechanism around it.

A *motion* is a place, an angle or a driver's coordinate with its two derivatives by time,
quadratic in time. The block's kernels are called with them as they are. In the rig, each
outer joint is wired to a marker of a turntable on two crossed slides, so that three drivers
give it any motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from blockmech.blocks.contract import Joint, Line, Moving
from blockmech.blocks.crank import Crank
from blockmech.blocks.frame import Frame
from blockmech.blocks.slide_drive import SlideDrive
from blockmech.engines.binding import bind_functions
from blockmech.engines.numpy import Planar, primitives
from blockmech.friction.laws import Coulomb
from blockmech.ground.values import Link, Marker, Place, Vector
from blockmech.loads.applied import Couple, Force
from blockmech.mechanism import Mechanism
from blockmech.model.graph import Graph
from blockmech.testing.rules import planar, vectors
from blockmech.typing import (
    Array,
    Complex,
    Data,
    Guide,
    LinkAcceleration,
    LinkVelocity,
    Load,
    Nested,
    Parameters,
    Values,
)

STAGES = {"position": 0, "velocity": 1, "acceleration": 2, "reactions": 1}
"""Each kernel, and how many of its arguments come from earlier kernels."""

ARM, TURN = 0.3 + 0.2j, 0.4  # where a turntable carries the marker, and how it is turned there


def random_motions(block: Moving, n: int, size: float, seed: int) -> Array:
    """Motions (rows, 3, n) at random, speeds about ``size`` a second.

    Two rows an outer joint, its place [m] and the angle [rad] of its guide, and one of a
    driven joint's coordinate; of each the value and its derivatives by time.
    """
    chance = np.random.default_rng(seed)

    def numbers(*scales: float) -> Array:
        return np.array(scales)[:, None] * chance.uniform(-1, 1, (3, n))

    rows = []
    for joint in block.joints.values():
        if joint.outer:
            rows.append(numbers(size, size, size) + 1j * numbers(size, size, size))
            rows.append(numbers(np.pi, 1.0, 1.0) + 0j)
    for joint in block.driven:
        scale = 1.0 if joint.rotary else size
        rows.append(numbers(3 * scale, scale, scale) + 0j)
    return np.array(rows)


def after(motions: Array, t: float) -> Array:
    """All motions a time t [s] later."""
    return np.array([[1.0, t, t * t / 2], [0.0, 1.0, t], [0.0, 0.0, 1.0]]) @ motions


class Subject:
    """A block, its kernels bound to NumPy batches, and where its links have its joints."""

    def __init__(self, block: Moving) -> None:
        self.block = block
        self.outer = [j for j in block.joints.values() if j.outer]
        self.slides = [j for j in block.joints.values() if j.kind == "P"]
        self.p = block.parameters()
        kernels = {name: getattr(block.kernels, name) for name in STAGES}
        self._kernels = bind_functions(kernels, primitives(np.float64))

    def read(self, motions: Array, joint: Joint) -> tuple[Array, Array]:
        """Motion (3, n) of the place that an outer joint reads, and of its guide's angle."""
        row = 2 * self.outer.index(joint)
        return motions[row], motions[row + 1].real

    # -- kernels ---------------------------------------------------------------------------

    def arguments(self, stage: str, motions: Array) -> list[Complex]:
        """What the kernel of a stage gets of the motions, in the contract's order."""
        k, arguments_ = STAGES[stage], []
        for joint in self.outer:
            motion, turn = self.read(motions, joint)
            z, angle = planar(motion[k]), turn[k]
            turned: Complex = planar(np.exp(1j * angle)) if k == 0 else angle
            guide = (Guide, LinkVelocity, LinkAcceleration)[k](z, turned)
            arguments_.append(guide if joint.reads == "guide" else z)
        return [*arguments_, *([motions[-1][k].real] if self.block.driven else [])]

    def call(self, stage: str, *arguments: Nested, p: Parameters | None = None) -> Any:
        """Call a kernel on batches; divisions by zero give infinity or NaN."""
        with np.errstate(all="ignore"):
            return self._kernels[stage](*arguments, _cast(self.p if p is None else p))

    def position(self, motions: Array) -> Any:
        """The pose at the motions' samples."""
        return self.call("position", *self.arguments("position", motions))

    def velocity(self, motions: Array, pose: Any = None) -> Any:
        """The velocities, by default at the motions' own pose."""
        pose = self.position(motions) if pose is None else pose
        return self.call("velocity", pose, *self.arguments("velocity", motions))

    def acceleration(self, motions: Array, pose: Any, vel: Any) -> Any:
        """The accelerations at a pose with its velocities."""
        return self.call("acceleration", pose, vel, *self.arguments("acceleration", motions))

    # -- where the parts of its joints are, by declarations and link places alone ----------

    def gaps(self, pose: Values, motions: Array) -> Iterator[tuple[str, Array, str]]:
        """How far the parts of each joint are from each other: what, how far, its unit."""
        for joint in self.block.joints.values():
            if joint.kind == "P":
                point, u = self._line(pose, joint, joint.later)
                base, axis = self._base(pose, joint, motions)
                yield (
                    f"gap at joint {joint.name}",
                    abs(((point - base) * np.conj(axis)).imag),
                    "m",
                )
                yield f"angle at joint {joint.name}", abs(u - axis), ""
                continue
            pins = self._pins(pose, joint)
            if not pins:
                raise LookupError(f"no built-in marker {joint.name} on a link of the joint")
            for pin in [*pins, *([self.read(motions, joint)[0][0]] if joint.outer else [])][1:]:
                yield f"gap at joint {joint.name}", abs(pin - pins[0]), "m"

    def stroke(self, pose: Values, joint: Joint, motions: Array) -> Array:
        """How far [m] the later link's point has slid on the earlier link's guide."""
        point, _ = self._line(pose, joint, joint.later)
        base, u = self._base(pose, joint, motions)
        return np.asarray(((point - base) * np.conj(u)).real)

    def _line(self, pose: Values, joint: Joint, link: str) -> tuple[Array, Array]:
        """A point of a guide line on one of the block's links, and its direction."""
        link_pose, line = getattr(pose, link), joint.lines.get(link, Line())
        e = vectors(link_pose.e)
        turn = float(getattr(self.block, line.turn)) if line.turn else 0.0
        at = self.block.slider_place(joint.name, link)
        return vectors(link_pose.o) + e * at, e * np.exp(1j * turn)

    def _base(self, pose: Values, joint: Joint, motions: Array) -> tuple[Array, Array]:
        """A point of the guide line on the earlier link, and its direction."""
        if not joint.outer:
            return self._line(pose, joint, joint.links[0])
        motion, angle = self.read(motions, joint)
        return motion[0], np.exp(1j * angle[0])

    def _pins(self, pose: Values, joint: Joint) -> list[Array]:
        """Places of the built-in markers that stand for a revolute joint."""
        pins = []
        for name in (joint.name, f"{joint.name}j"):
            marker = self.block.built_in.get(name)
            if marker and marker.link in (joint.link, *joint.links):
                distance = (getattr(self.block, marker.along) or 0.0) if marker.along else 0.0
                link_pose = getattr(pose, marker.link)
                pins.append(vectors(link_pose.o) + vectors(link_pose.e) * distance)
        return pins


def random_loads(block: Moving, n: int, size: float, seed: int) -> list[Load]:
    """Random forces and moments (n,) on each link."""
    rows = np.random.default_rng(seed).normal(size=(len(block.link_names), 3, n))
    return [Load(planar(x + 1j * y), size * m) for x, y, m in rows]


def _cast(p: Nested) -> Any:
    """Parameters for kernels on batches."""
    if isinstance(p, tuple) and not isinstance(p, Planar):
        return type(p)(*map(_cast, p)) if hasattr(p, "_fields") else tuple(map(_cast, p))
    return planar(p) if isinstance(p, complex) else p


# ---- the mechanism -----------------------------------------------------------------------


def rig(block: Moving, size: float, friction: bool) -> Mechanism:
    """The block on turntables, its links massive and loaded, its joints with friction."""
    graph = Graph("rig", gravity=(0.6, -9.81))
    graph.add("frame", Frame(markers={"x": Marker(at=Place(0j), angle=0.0)}))
    outer = [joint.name for joint in block.joints.values() if joint.outer]
    for joint in outer:
        marker = Marker(at=Place(size * ARM), angle=TURN)
        table = Link(mass=0.4, inertia=0.1 * size**2, markers={"hand": marker})
        add_turntable(graph, joint, table, (0.5, 0.7))
    load = Marker(at=Place(size * (0.3 + 0.2j)))
    links = {
        name: Link(
            mass=1.0 + 0.3 * k,
            inertia=(0.2 + 0.1 * k) * size**2,
            cm=Place(size * (0.2 - 0.1j * (k + 1))),
            markers={**block.links_or_default()[name].markers, f"load{k}": load},
        )
        for k, name in enumerate(block.link_names)
    }
    laws = {
        "R": Coulomb(coefficient=0.1, radius=0.02 * size),
        "P": Coulomb(coefficient=0.05, guide_length=size),
    }
    friction_laws = {name: laws[j.kind] for name, j in block.joints.items()} if friction else {}
    graph.add("block", block.model_copy(update={"links": links, "friction": friction_laws}))
    for joint in outer:
        graph.connect(f"turn_{joint}.hand", f"block.{joint}")
    for k, name in enumerate(block.link_names):
        graph.add(f"force{k}", Force(force=Vector(3.0 - k + 1j * (5.0 + 2 * k)), axes="link"))
        graph.add(f"couple{k}", Couple(moment=(2.0 - 3 * k) * size))
        graph.connect(f"block.load{k}", f"force{k}.at")
        graph.connect(f"block.{name}", f"couple{k}.on")
    return Mechanism._from_graph(graph)


def add_turntable(
    graph: Graph, name: str, table: Link, masses: tuple[float, float] = (0.0, 0.0)
) -> None:
    """Three drivers x, y and turn that move a link in any way."""
    upright = {"y": Marker(at=Place(0j), dir=Vector(1j))}
    x, y = (Link(mass=m) for m in masses)
    graph.add(f"x_{name}", SlideDrive(links={"slider": x.model_copy(update={"markers": upright})}))
    graph.add(f"y_{name}", SlideDrive(links={"slider": y}))
    graph.add(f"turn_{name}", Crank(links={"crank": table}))
    graph.connect("frame.x", f"x_{name}.S")
    graph.connect(f"x_{name}.y", f"y_{name}.S")
    graph.connect(f"y_{name}.S", f"turn_{name}.A")


def request(subject: Subject, motions: Array, size: float) -> Data:
    """Driver coordinates, rates and accelerations that make the motions in the rig."""
    rows = {"block": motions[-1].real} if subject.block.driven else {}
    for joint in subject.outer:
        motion, turn = subject.read(motions, joint)
        phi, om, al = turn
        arm = size * ARM * np.exp(1j * (phi - TURN))
        z = motion - np.array([arm, 1j * om * arm, (1j * al - om**2) * arm])
        rows |= {f"x_{joint.name}": z.real, f"y_{joint.name}": z.imag}
        # The y slide has turned the table by a quarter.
        rows[f"turn_{joint.name}"] = turn - np.array([[TURN + np.pi / 2], [0.0], [0.0]])
    return {
        key: {name: np.asarray(row[k], float) for name, row in rows.items()}
        for k, key in enumerate(("at", "rates", "accelerations"))
    }
