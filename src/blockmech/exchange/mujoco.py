"""MJCF: planar models of MuJoCo, a tree of bodies and what closes its loops.

A hinge is a pin and a slide a guide between a body and its parent, ``equality/connect`` a pin and
``weld`` a weld of two bodies, ``equality/joint`` a polynomial of one coordinate in another. An
actuator drives its joint. Masses are those of ``inertial``, else of the geoms. Attributes are those
of an element, else of its class among the defaults. Angles are degrees unless the compiler says
radian.

Source: MuJoCo documentation, XML reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from blockmech.exchange.drawing import FRAME, FREE, Drawing, Ratio
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import Record, number, wrong, xml_of
from blockmech.exchange.spatial import (
    Assembly,
    Joint,
    Mass,
    Pose,
    axes_along,
    quaternion,
    turned,
    unit,
)
from blockmech.ground.errors import listed
from blockmech.ground.names import free_name
from blockmech.typing import Floats

ACTUATORS = ("motor", "position", "velocity", "general", "intvelocity", "damper", "cylinder")
DENSITY = 1000.0  # [kg/m3] of a geom that names none
LOOKS = {"asset", "visual", "statistic", "size", "custom", "sensor", "light", "camera", "contact"}
LOOKS |= {"keyframe", "rgba", "material", "group", "contype", "conaffinity", "condim", "friction"}
LOOKS |= {"solref", "solimp", "solreflimit", "solimplimit", "margin", "gap", "timestep", "flag"}
LOOKS |= {"integrator", "solver", "iterations", "tolerance", "priority", "solmix", "option cone"}
LOOKS |= {"energy", "warmstart", "filterparent", "refsafe", "clampctrl", "actuation", "midphase"}
LOOKS |= {"eulerdamp", "autoreset", "nativeccd", "island", "multiccd", "override", "fusestatic"}
LOOKS |= {"cone", "ctrlrange", "ctrllimited", "forcerange", "forcelimited", "kp", "kv", "gear"}
LOOKS |= {"meshdir", "texturedir", "name", "class", "user", "assetdir", "model", "default"}
LOOKS |= {"impratio", "mocap", "strippath", "usethread"}
ELSEWHERE = ("include", "replicate", "attach")  # what stands for parts that are not written out


def read(text: str, where: str) -> Drawing:
    """The drawing of a model in its reference pose."""
    root = xml_of(text, where)
    if shorthand := next((part.tag for part in root.walk() if part.tag in ELSEWHERE), None):
        remedy = "load it in MuJoCo, save it by mj_saveLastXML and read that"
        raise wrong(where, f"<{shorthand}> stands for parts of the model", "all bodies", remedy)
    if root.tag != "mujoco" or not root.all("worldbody"):
        raise wrong(where, "it has no worldbody", "<mujoco> with a <worldbody>")
    return _Reading(root, where).read()


class Frame(NamedTuple):
    """A body or a frame in it, where it is, and the class of what names none."""

    record: Record
    pose: Pose
    inherited: str


class _Reading:
    def __init__(self, root: Record, where: str) -> None:
        self.root, self.where = root, where
        self.assembly = Assembly(where, Drawing(root.get("model") or "mujoco", "m", "MJCF file"))
        compiler = root.first("compiler")
        self.unit = 1.0 if compiler.get("angle") == "radian" else math.pi / 180
        self.order = compiler.get("eulerseq", "xyz")
        self.of_geoms = compiler.get("inertiafromgeom", "auto")
        self.limited = compiler.get("autolimits", "true") != "false"
        self.balanced = compiler.get("balanceinertia") == "true"
        if compiler.get("coordinate", "local") != "local":
            raise wrong(where, "its coordinates are global", "local", "save it in MuJoCo 2.3.3")
        self.defaults: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for record in root.all("default"):
            self._default(record, {}, "main")
        self.poses = {"world": Pose()}
        self.links = {"world": FRAME}
        self.sites: dict[str, tuple[str, Pose]] = {}
        self.references: dict[str, float] = {}

    def _default(self, record: Record, outer: dict[str, dict[str, str]], name: str) -> None:
        attributes = {tag: dict(fields) for tag, fields in outer.items()}
        for part in record.inner:
            if part.tag != "default":
                attributes.setdefault(part.tag, {}).update(part.fields)
                part.skip()
        self.defaults[record.get("class") or name] = attributes
        record.consumed.update(part.tag for part in record.inner)
        for part in record.all("default"):
            self._default(part, attributes, "")

    def _of_class(self, record: Record, inherited: str) -> Record:
        """A record with what its class among the defaults says."""
        defaults = self.defaults.get(record.get("class") or inherited or "main", {})
        record.fields = {**defaults.get(record.tag, {}), **record.fields}
        return record

    def read(self) -> Drawing:
        """The drawing, with what was not read among its notes."""
        root, assembly = self.root, self.assembly
        for world in root.all("worldbody"):
            self._inside(self._frames(world, Pose(), ""), "world")
        for k, record in enumerate(root.below("equality"), 1):
            self._equality(self._of_class(record, ""), f"{record.tag}_{k}")
        for record in root.below("actuator"):
            self._actuator(self._of_class(record, ""))
        if total := root.first("compiler").number("settotalmass", -1.0):
            self._scale_masses(total)
        option = root.first("option")
        flag = option.first("flag")
        flag.consumed |= {name for name, switch in flag.fields.items() if switch == "enable"}
        if flag.get("gravity") != "disable":
            assembly.gravity = np.array(option.numbers("gravity", 3, "0 0 -9.81"))
        for name, (body, pose) in self.sites.items():
            if self.links[body] != FRAME and name not in assembly.drawing.points:
                assembly.drawing.points[name] = assembly.flat(pose.origin)
                assembly.drawing.links.setdefault(self.links[body], []).append(name)
        return assembly.project(root, LOOKS)

    # -- places -------------------------------------------------------------------

    def _rotation(self, record: Record) -> Floats:
        where = record.where
        if record.get("quat"):
            return quaternion(record.numbers("quat", 4), where)
        if record.get("euler"):
            return self._euler(record.numbers("euler", 3))
        if record.get("axisangle"):
            *axis, angle = record.numbers("axisangle", 4)
            return turned(unit(axis, where), angle * self.unit)
        if record.get("xyaxes"):
            numbers = np.array(record.numbers("xyaxes", 6))
            x = unit(numbers[:3], where)
            y = unit(numbers[3:] - x * (x @ numbers[3:]), where)
            return np.column_stack([x, y, np.cross(x, y)])
        if record.get("zaxis"):
            return axes_along(unit(record.numbers("zaxis", 3), where))
        return np.eye(3)

    def _euler(self, angles: Sequence[float]) -> Floats:
        axes = np.eye(3)
        for letter, angle in zip(self.order, angles, strict=True):
            turn = turned(np.eye(3)["xyz".index(letter.lower())], angle * self.unit)
            axes = axes @ turn if letter.islower() else turn @ axes
        return axes

    def _pose(self, record: Record, outer: Pose) -> Pose:
        return outer.at(record.numbers("pos", 3, "0 0 0"), self._rotation(record))

    # -- bodies -------------------------------------------------------------------

    def _frames(self, record: Record, pose: Pose, inherited: str) -> list[Frame]:
        """A body and the frames in it."""
        inherited = record.get("childclass") or inherited
        inner = (self._frames(f, self._pose(f, pose), inherited) for f in record.all("frame"))
        return [Frame(record, pose, inherited), *(frame for frames in inner for frame in frames)]

    def _parts(self, frames: list[Frame], tag: str) -> list[tuple[Record, Pose]]:
        """The parts of a name in frames, as their classes complete them."""
        return [
            (self._of_class(part, frame.inherited), frame.pose)
            for frame in frames
            for part in frame.record.all(tag)
        ]

    def _inside(self, frames: list[Frame], body: str) -> None:
        """Sites and bodies in a body."""
        for site, pose in self._parts(frames, "site"):
            name = site.get("name") or f"site_{len(self.sites)}"
            self.sites[name] = body, self._pose(site, pose)
            site.consumed |= {"size", "type"}
        for frame in frames:
            for inner in frame.record.all("body"):
                self._body(inner, body, frame)
            if self.links[body] == FRAME:  # what else is there moves nothing
                for part in frame.record.all("geom", "joint", "inertial", "freejoint"):
                    part.skip()

    def _body(self, record: Record, parent: str, outer: Frame) -> None:
        name = record.get("name") or f"body_{len(self.poses)}"
        if name in self.poses:
            raise wrong(record.where, "there are two bodies of this name")
        pose = self.poses[name] = self._pose(record, outer.pose)
        frames = self._frames(record, pose, outer.inherited)
        joints = self._parts(frames, "joint")
        if record.all("freejoint") or any(j.get("type") == "free" for j, _ in joints):
            raise wrong(record.where, "it moves freely in space", "hinges and slides in one plane")
        base = self.links[name] = self.links[parent]
        for k, (joint, at) in enumerate(joints, 1):  # each hangs on what the one before it moves
            link = name if k == len(joints) else free_name(f"{name}_{k}", self.links)
            self.assembly.masses[link] = []
            self._joint(joint, base, link, at)
            base = self.links[name] = link
        masses = self._masses(frames)
        if base != FRAME:
            self.assembly.masses[base] += masses
        self._inside(frames, name)

    def _joint(self, record: Record, base: str, link: str, pose: Pose) -> None:
        key, kind = record.get("name") or f"joint_{link}", record.get("type", "hinge")
        if kind not in ("hinge", "slide", "ball"):
            raise wrong(record.where, f"joint {key} is a {kind}", "hinge or slide")
        axis = unit(record.numbers("axis", 3, "0 0 1"), record.where)
        at = pose.at(record.numbers("pos", 3, "0 0 0"), axes_along(axis))
        scale = self.unit if kind != "slide" else 1.0
        start = self.references[key] = record.number("ref", 0.0) * scale
        limits = FREE
        flag, text = record.get("limited", "auto"), record.get("range")
        if text and (flag == "true" or (flag == "auto" and self.limited)):
            low, high = record.numbers("range", 2)
            limits = (low * scale - start, high * scale - start)
        for word in ("frictionloss", "armature"):
            if record.number(word, 0.0):
                self.assembly.drawing.note(f"{word} of joint {key}: left out")
        rest = record.number("springref", 0.0) * scale - start
        stiffness, damping = record.number("stiffness", 0.0), record.number("damping", 0.0)
        kinds = {"hinge": "pin", "slide": "slide", "ball": "ball"}
        joint = Joint(key, kinds[kind], base, link, at, at, limits=limits)
        joint = joint._replace(stiffness=stiffness, rest=rest, damping=damping)
        self.assembly.join(joint)

    def _masses(self, frames: list[Frame]) -> list[Mass]:
        inertial = [self._inertial(*part) for part in self._parts(frames, "inertial")]
        geoms = self._parts(frames, "geom")
        if self.of_geoms == "false" or (inertial and self.of_geoms != "true"):
            for geom, _ in geoms:
                geom.skip()
            return inertial
        return [mass for part in geoms for mass in self._geom(*part)]

    def _inertial(self, record: Record, pose: Pose) -> Mass:
        at = self._pose(record, pose)
        if record.get("fullinertia"):
            xx, yy, zz, xy, xz, yz = record.numbers("fullinertia", 6)
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            moments = np.array(record.numbers("diaginertia", 3))
            if self.balanced and 2 * moments.max() > moments.sum():
                moments[:] = moments.mean()
            inertia = np.diag(moments)
        return Mass(record.number("mass"), at.origin, at.axes @ inertia @ at.axes.T)

    def _geom(self, record: Record, pose: Pose) -> list[Mass]:
        kind = record.get("type", "sphere")
        sizes = [number(x, f"{record.where}, size") for x in record.get("size").split()]
        at = self._pose(record, pose)
        if record.get("fromto"):
            ends = np.array(record.numbers("fromto", 6)).reshape(2, 3)
            axis = ends[1] - ends[0]
            half = float(np.linalg.norm(axis)) / 2
            at = pose.at(ends.mean(axis=0), axes_along(unit(axis, record.where)))
            sizes = [*sizes[:1] * (1 if kind in ("capsule", "cylinder") else 2), half]
        body = solid(kind, sizes) if min(sizes, default=0.0) > 0 else None
        density, mass = record.number("density", DENSITY), record.get("mass")
        if body is None:
            if kind != "plane":
                self.assembly.drawing.note(f"{record.where}: a {kind} has no mass here")
            return []
        volume, inertia = body
        total = record.number("mass") if mass else density * volume
        return [Mass(total, at.origin, total * at.axes @ inertia @ at.axes.T)] if total else []

    # -- what joins them besides ------------------------------------------------------

    def _site(self, record: Record, number_: int) -> tuple[str, Pose | None]:
        """A body that an equality names, and where a site of it is."""
        if site := record.get(f"site{number_}"):
            if site not in self.sites:
                raise wrong(record.where, f"no site {site}", f"sites: {listed(self.sites)}")
            return self.sites[site]
        name = record.get(f"body{number_}") or "world"
        if name not in self.links:
            raise wrong(record.where, f"no body {name}", f"bodies: {listed(self.links)}")
        return name, None

    def _equality(self, record: Record, name: str) -> None:
        assembly, name = self.assembly, record.get("name") or name
        if record.get("active") == "false" or record.tag not in ("connect", "weld", "joint"):
            assembly.drawing.note(f"equality {record.tag} {name}: left out")
            record.skip()
            return
        if record.tag == "joint":
            self._ratio(record, name)
            return
        (first, at), (second, second_at) = self._site(record, 1), self._site(record, 2)
        ends = (self.links[first], self.links[second])
        if record.tag == "connect":
            at = at or self.poses[first].at(record.numbers("anchor", 3, "0 0 0"))
            assembly.join(Joint(name, "ball", *ends, at, second_at or at))
            return
        record.consumed |= {"torquescale", "anchor"}
        *position, w, x, y, z = record.numbers("relpose", 7, "0 1 0 0 0 0 0")
        if at is None and any((w, x, y, z)):
            at = self.poses[first].at(position, quaternion((w, x, y, z), record.where))
            second_at = self.poses[second]
        at = at or self.poses[second]
        assembly.join(Joint(name, "weld", *ends, at, second_at or at))

    def _ratio(self, record: Record, name: str) -> None:
        driven, leading = record.get("joint1"), record.get("joint2")
        numbers = (record.get("polycoef") or "0 1 0 0 0").split()
        coefficients = tuple(number(x, f"{record.where}, polycoef") for x in numbers)
        for joint in filter(None, (driven, leading)):
            if joint not in self.references:
                valid = f"joints: {listed(self.references)}"
                raise wrong(record.where, f"no joint {joint}", valid)
        if leading:
            self.assembly.ratios.append(Ratio(name, leading, driven, coefficients))
        else:
            law = {"law": "constant_rate", "rate": 0.0, "from": coefficients[0]}
            self.assembly.change(driven, law=law | {"to": coefficients[0]})

    def _actuator(self, record: Record) -> None:
        joint = record.get("joint") or record.get("jointinparent")
        if record.tag not in ACTUATORS or joint not in self.references:
            name = record.get("name") or record.tag
            self.assembly.drawing.note(f"actuator {name}: left out")
            record.skip()
            return
        self.assembly.change(joint, law={})

    def _scale_masses(self, total: float) -> None:
        """Scale all masses so that they sum up to a total [kg], if that is positive."""
        masses = self.assembly.masses
        factor = total / (sum(mass.mass for several in masses.values() for mass in several) or 1.0)
        if total > 0:
            for several in masses.values():
                several[:] = [Mass(m.mass * factor, m.centre, m.inertia * factor) for m in several]


READER = Reader(
    "MJCF: a planar model of MuJoCo",
    (".xml", ".mjcf"),
    lambda text: "<mujoco" in text[:2000],
    read,
)


def _axisymmetric(volume: float, axial: float, transverse: float) -> tuple[float, Floats]:
    """Volume, and the inertia of a unit mass about z and about what is square to it."""
    return volume, np.diag([transverse, transverse, axial])


def ellipsoid(a: float, b: float, c: float) -> tuple[float, Floats]:
    """Half axes [m]."""
    x, y, z = a * a, b * b, c * c
    return 4 / 3 * math.pi * a * b * c, np.diag([y + z, x + z, x + y]) / 5


def sphere(radius: float) -> tuple[float, Floats]:
    """Radius [m]."""
    return ellipsoid(radius, radius, radius)


def box(a: float, b: float, c: float) -> tuple[float, Floats]:
    """Half edges [m]."""
    x, y, z = a * a, b * b, c * c
    return 8 * a * b * c, np.diag([y + z, x + z, x + y]) / 3


def cylinder(radius: float, half: float) -> tuple[float, Floats]:
    """Radius [m] and half of the length [m] along z."""
    square = radius**2
    return _axisymmetric(2 * math.pi * square * half, square / 2, square / 4 + half**2 / 3)


def capsule(radius: float, half: float) -> tuple[float, Floats]:
    """Radius [m], and half of the length [m] along z between the centres of both ends."""
    square, ends = radius**2, 4 / 3 * math.pi * radius**3
    tube = 2 * math.pi * square * half
    axial = tube * square / 2 + ends * square * 2 / 5
    transverse = tube * (square / 4 + half**2 / 3)
    transverse += ends * (square * 2 / 5 + half**2 + 3 / 4 * half * radius)
    volume = tube + ends
    return _axisymmetric(volume, axial / volume, transverse / volume)


SHAPES: dict[str, tuple[int, Callable[..., tuple[float, Floats]]]] = {
    "sphere": (1, sphere),
    "capsule": (2, capsule),
    "cylinder": (2, cylinder),
    "ellipsoid": (3, ellipsoid),
    "box": (3, box),
}
"""Shape -> how many sizes it has, and its volume [m3] and inertia of a unit mass [m2]."""


def solid(kind: str, sizes: Sequence[float]) -> tuple[float, Floats] | None:
    """Volume [m3] and inertia of a unit mass [m2] of a shape; None for what is none."""
    count, shape = SHAPES.get(kind, (0, sphere))
    return shape(*sizes[:count]) if count and len(sizes) >= count else None
