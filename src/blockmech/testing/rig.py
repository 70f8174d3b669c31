"""A test rig for one block: each outer joint hangs on a link that moves in any way.

Every outer joint is wired to a marker of a turntable on two crossed slides, so three
drivers give its marker any place, direction, velocity and acceleration. The block's
kernels can be called with the same motions, without any wires.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blockmech.blocks.contract import Moving
from blockmech.blocks.crank import Crank
from blockmech.blocks.frame import Frame
from blockmech.blocks.slide_drive import SlideDrive
from blockmech.builders import Graph
from blockmech.engines.binding import bind_functions
from blockmech.engines.numpy import Planar, primitives
from blockmech.friction.laws import Coulomb
from blockmech.loads.couple import Couple
from blockmech.loads.force import Force
from blockmech.mechanism import Mechanism
from blockmech.typing import Guide, GuideAcceleration, GuideVelocity
from blockmech.values import Link, Marker, Place, Vector

Array = NDArray[Any]
ARM, TURN = 0.3 + 0.2j, 0.4  # where a turntable carries the marker, and how it is turned there


@dataclass(frozen=True)
class MarkerMotion:
    """Motion of the marker wired to a joint, n samples; quadratic in time."""

    p: Array  # complex (n,) [m]
    phi: Array  # (n,) [rad] angle of the marker's direction
    v: Array
    om: Array
    a: Array
    al: Array

    def after(self, t: float) -> MarkerMotion:
        """The same motion a time t [s] later."""
        return MarkerMotion(
            self.p + t * (self.v + t * self.a / 2),
            self.phi + t * (self.om + t * self.al / 2),
            self.v + t * self.a,
            self.om + t * self.al,
            self.a,
            self.al,
        )

    def only(self, samples: Any) -> MarkerMotion:
        """Some of the samples."""
        return MarkerMotion(*(x[samples] for x in vars(self).values()))


@dataclass(frozen=True)
class DriveMotion:
    """Motion of a driver's own coordinate, n samples; quadratic in time."""

    q: Array
    qd: Array
    qdd: Array

    def after(self, t: float) -> DriveMotion:
        """The same motion a time t [s] later."""
        return DriveMotion(
            self.q + t * (self.qd + t * self.qdd / 2), self.qd + t * self.qdd, self.qdd
        )

    def only(self, samples: Any) -> DriveMotion:
        """Some of the samples."""
        return DriveMotion(*(x[samples] for x in vars(self).values()))


Motions = Mapping[str, MarkerMotion | DriveMotion]
DRIVE = ""  # the key of a driving link's own coordinate


def after(motions: Motions, t: float) -> Motions:
    """All motions a time t [s] later."""
    return {name: m.after(t) for name, m in motions.items()}


def only(motions: Motions, samples: Any) -> Motions:
    """Some samples of all motions."""
    return {name: m.only(samples) for name, m in motions.items()}


def random_motions(block: Moving, n: int, size: float, seed: int) -> Motions:
    """Motions of all outer joints at random, speeds about ``size`` a second."""
    chance = np.random.default_rng(seed)

    def vectors() -> Array:
        return size * (chance.uniform(-1, 1, n) + 1j * chance.uniform(-1, 1, n))

    def numbers(scale: float = 1.0) -> Array:
        return scale * chance.uniform(-1, 1, n)

    found: dict[str, MarkerMotion | DriveMotion] = {}
    for joint in block.joints.values():
        if joint.outer:
            found[joint.name] = MarkerMotion(
                vectors(), numbers(np.pi), vectors(), numbers(), vectors(), numbers()
            )
    for joint in block.driven:
        scale = 1.0 if joint.rotary else size
        found[DRIVE] = DriveMotion(numbers(3 * scale), numbers(scale), numbers(scale))
    return found


class Subject:
    """A block and its kernels, bound to NumPy batches."""

    def __init__(self, block: Moving) -> None:
        self.block = block
        self.outer = [j for j in block.joints.values() if j.outer]
        self.p = block.parameters()
        stages = ("position", "velocity", "acceleration", "reactions")
        kernels = {name: getattr(block.kernels, name) for name in stages}
        self._kernels = bind_functions(kernels, primitives(np.float64))

    def arguments(self, stage: str, motions: Motions) -> list[Any]:
        """What the kernel of a stage gets of the motions, in the contract's order."""
        found = [self._reading(stage, j.reads, motions[j.name]) for j in self.outer]
        drive = motions.get(DRIVE)
        if isinstance(drive, DriveMotion):
            found.append(
                {"position": drive.q, "velocity": drive.qd, "acceleration": drive.qdd}[stage]
            )
        return found

    def _reading(self, stage: str, reads: str, m: Any) -> Any:
        if stage == "position":
            p = planar(m.p)
            return Guide(p, planar(np.exp(1j * m.phi))) if reads == "guide" else p
        if stage == "velocity":
            v = planar(m.v)
            return GuideVelocity(v, m.om) if reads == "guide" else v
        a = planar(m.a)
        return GuideAcceleration(a, m.al) if reads == "guide" else a

    def call(self, stage: str, *arguments: Any, p: Any = None) -> Any:
        """Call a kernel on batches; divisions by zero give infinity or NaN."""
        with np.errstate(all="ignore"):
            return self._kernels[stage](*arguments, cast(self.p if p is None else p))

    def position(self, motions: Motions) -> Any:
        """The pose at the motions' samples."""
        return self.call("position", *self.arguments("position", motions))

    def velocity(self, motions: Motions, pose: Any = None) -> Any:
        """The velocities."""
        pose = self.position(motions) if pose is None else pose
        return self.call("velocity", pose, *self.arguments("velocity", motions))

    def acceleration(self, motions: Motions) -> Any:
        """The accelerations."""
        pose = self.position(motions)
        vel = self.velocity(motions, pose)
        return self.call("acceleration", pose, vel, *self.arguments("acceleration", motions))


def planar(z: Any) -> Planar:
    """A batch of vectors for kernels."""
    z = np.asarray(z, complex)
    return Planar(z.real.copy(), z.imag.copy())


def cast(p: Any) -> Any:
    """Parameters for kernels on batches."""
    if isinstance(p, tuple):
        return type(p)(*map(cast, p)) if hasattr(p, "_fields") else tuple(map(cast, p))
    return planar(p) if isinstance(p, complex) else p


# -- the mechanism -------------------------------------------------------------------


def rig(block: Moving, size: float, friction: bool) -> Mechanism:
    """The block on turntables, its links massive and loaded, its joints with friction."""
    graph = Graph("rig", gravity=(0.6, -9.81))
    graph.add("frame", Frame(markers={"x": Marker(at=Place(0j), angle=0.0)}))
    for joint in block.joints.values():
        if joint.outer:
            _turntable(graph, joint.name, size)
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
    laws = {name: _law(j.kind, size) for name, j in block.joints.items()} if friction else {}
    graph.add("block", block.model_copy(update={"links": links, "friction": laws}))
    for joint in block.joints.values():
        if joint.outer:
            graph.connect(f"turn_{joint.name}.hand", f"block.{joint.name}")
    for k, name in enumerate(block.link_names):
        graph.add(f"force{k}", Force(force=Vector(3.0 - k + 1j * (5.0 + 2 * k)), axes="link"))
        graph.add(f"couple{k}", Couple(moment=(2.0 - 3 * k) * size))
        graph.connect(f"block.load{k}", f"force{k}.at")
        graph.connect(f"block.{name}", f"couple{k}.on")
    return graph.compile()


def _turntable(graph: Graph, joint: str, size: float) -> None:
    """Three drivers x, y and turn that move a marker in any way."""
    upright = {"slider": Link(mass=0.5, markers={"y": Marker(at=Place(0j), dir=Vector(1j))})}
    graph.add(f"x_{joint}", SlideDrive(links=upright))
    graph.add(f"y_{joint}", SlideDrive(links={"slider": Link(mass=0.7)}))
    marker = Marker(at=Place(size * ARM), angle=TURN)
    table = Link(mass=0.4, inertia=0.1 * size**2, markers={"hand": marker})
    graph.add(f"turn_{joint}", Crank(links={"crank": table}))
    graph.connect("frame.x", f"x_{joint}.S")
    graph.connect(f"x_{joint}.y", f"y_{joint}.S")
    graph.connect(f"y_{joint}.S", f"turn_{joint}.A")


def _law(kind: str, size: float) -> Coulomb:
    if kind == "R":
        return Coulomb(coefficient=0.1, radius=0.02 * size)
    return Coulomb(coefficient=0.05, guide_length=size)


def request(motions: Motions, size: float) -> dict[str, Any]:
    """Driver coordinates, rates and accelerations that make the motions in the rig."""
    found: dict[str, dict[str, Array]] = {"at": {}, "rates": {}, "accelerations": {}}

    def drive(name: str, q: Array, qd: Array, qdd: Array) -> None:
        for key, x in zip(found, (q, qd, qdd), strict=True):
            found[key][name] = np.asarray(x, float)

    for joint, m in motions.items():
        if isinstance(m, DriveMotion):
            drive("block", m.q, m.qd, m.qdd)
            continue
        theta = m.phi - TURN - np.pi / 2  # the y slide has turned the table by a quarter
        arm = size * ARM * np.exp(1j * (m.phi - TURN))
        o = m.p - arm
        v = m.v - 1j * m.om * arm
        a = m.a - (1j * m.al - m.om**2) * arm
        drive(f"x_{joint}", o.real, v.real, a.real)
        drive(f"y_{joint}", o.imag, v.imag, a.imag)
        drive(f"turn_{joint}", theta, m.om, m.al)
    return found
