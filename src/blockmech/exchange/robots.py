"""URDF and SDF: planar machines of ROS and Gazebo, a tree of links and what closes its loops.

Links are joined by revolute, continuous, prismatic and fixed joints; the root of URDF, and of SDF
what is joined to ``world`` or else the first link, is the frame. ``mimic`` and ``gearbox`` couple
coordinates. URDF closes no loop itself: ``loop_joint``, or an SDF joint in a ``gazebo`` element
does. Nothing in the files is driven, unless a ``transmission`` names its joint.

Sources: ROS wiki, urdf/XML; sdformat.org, specification 1.11.
"""

from __future__ import annotations

import math
import re

import numpy as np

from blockmech.exchange.drawing import FRAME, FREE, Drawing, Ratio, Wheels
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import Record, wrong, xml_of
from blockmech.exchange.spatial import (
    Assembly,
    Joint,
    Mass,
    Pose,
    axes_along,
    quaternion,
    roll_pitch_yaw,
    unit,
)
from blockmech.ground.errors import listed
from blockmech.ground.names import free_name, numbered_name

KINDS = {
    "revolute": "pin",
    "continuous": "pin",
    "hinge": "pin",
    "prismatic": "slide",
    "fixed": "weld",
    "ball": "ball",
    "spherical": "ball",
    "gearbox": "gearbox",
}
WORLD = "world"
LOOKS = {"visual", "collision", "material", "sensor", "plugin", "name", "version"}
LOOKS |= {"safety_controller", "calibration", "self_collide", "light", "scene", "physics", "gui"}
LOOKS |= {"effort", "velocity", "audio_source", "projector", "wind", "enable_wind", "stiffness"}
LOOKS |= {"allow_auto_disable", "dissipation", "provide_feedback"}
LOOKS |= {"canonical_link", "magnetic_field", "atmosphere", "spherical_coordinates", "state"}
LOOKS |= {"hardwareInterface", "actuator", "type"}


class _Robot:
    """Links, joints and frames by their names, behind those of the models around them.

    A link or frame stands on a base, a joint on its child or where its own pose says.
    """

    def __init__(self, where: str, name: str, source: str, main: str = "") -> None:
        """``main`` is the scope whose names stand alone."""
        self.where, self.main = where, main
        self.assembly = Assembly(where, Drawing(name or "robot", "m", source))
        self.poses: dict[str, Pose] = {WORLD: Pose()}
        self.frame = {WORLD}
        self.axes_of_models = False  # whether axes are those of the model, as before SDF 1.5
        self.links: dict[str, Record] = {}
        self.joints: dict[str, tuple[Record, str]] = {}  # by where they are, with their scope
        self.bases: dict[str, tuple[Record, str, str]] = {}  # and what they stand on

    def named(self, text: str, scope: str) -> str:
        """What a name in a scope is called in the drawing."""
        name = text if text in ("", WORLD) else f"{scope}{text}"
        return name.removeprefix(self.main)

    def ends(self, joint: Record, scope: str = "") -> tuple[str, str]:
        """Parent and child of a joint."""
        parent, child = (joint.get(x) or joint.first(x).get("link") for x in ("parent", "child"))
        return self.named(parent, scope), self.named(child, scope)

    def body(self, name: str) -> str:
        """What the drawing calls a link, or the one that a frame is attached to.

        Raises `FormatError` for one that there is not.
        """
        for _ in self.bases:
            if name not in self.bases or name in self.links:
                break
            name = self.bases[name][1]
        if name not in self.links and name != WORLD:
            raise wrong(self.where, f"no link {name[:40]}", f"links: {listed(self.links)}")
        return FRAME if name in self.frame else free_name(name, {FRAME})

    def pose(self, name: str, depth: int = 0) -> Pose:
        """Where something is. Raises `FormatError` for what there is not, and for circles."""
        if name not in self.poses:
            if depth > len(self.bases):
                message = "its joints and frames go round in a circle"
                raise wrong(self.where, message, "a tree of links")
            if name not in self.bases:
                valid = f"names: {listed([x for x in self.bases if '__model__' not in x])}"
                raise wrong(self.where, f"no link, joint or frame {name[:40]}", valid)
            record, base, scope = self.bases[name]
            if relative := record.first("pose").get("relative_to"):
                base = self.named(relative, scope)
            self.poses[name] = _placed(record, self.pose(base, depth + 1))
        return self.poses[name]

    def project(self, root: Record, mass: float, axis: str, gravity: list[float]) -> Drawing:
        """The drawing of it all; of links without a mass, and joints without an axis, the default.

        Raises `FormatError` for what leaves the plane.
        """
        for name, record in self.links.items():
            body = self.body(name)
            if body != FRAME:
                self.assembly.masses[body] = []
            if record.get("gravity") in ("false", "0"):
                self.assembly.drawing.note(f"gravity acts on {name}, too")
            inertial = record.first("inertial")
            self._mass(inertial, _placed(inertial, self.pose(name)), body, mass)
        for base, (record, scope) in self.joints.items():
            self._joint(record, scope, self.pose(base), axis)
        for record in root.all("loop_joint"):
            self._loop(record)
        for record in root.all("transmission", "ros2_control"):
            self._drive(record)
        self.assembly.gravity = np.array(gravity)
        return self.assembly.project(root, LOOKS)

    def _mass(self, record: Record, pose: Pose, link: str, default: float) -> None:
        """The inertial element of a link, its origin at ``pose``, with a mass and moments."""
        tensor = record.first("inertia")
        moments = [tensor.number(f"i{key}", default) for key in ("xx", "yy", "zz")]
        xy, xz, yz = (tensor.number(f"i{key}", 0.0) for key in ("xy", "xz", "yz"))
        inertia = np.diag(moments) + np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])
        element = record.first("mass")
        mass = (
            element.number("value", default) if element.fields else record.number("mass", default)
        )
        body = Mass(mass, pose.origin, pose.axes @ inertia @ pose.axes.T)
        if link != FRAME and (mass or inertia.any()):
            self.assembly.masses[link].append(body)

    def _joint(self, record: Record, scope: str, pose: Pose, default: str) -> None:
        name, axis = self.named(record.get("name"), scope), record.first("axis")
        direction = unit(axis.numbers("xyz", 3, default), record.where)
        outer = axis.first("xyz").get("expressed_in")
        if self.axes_of_models or axis.get("use_parent_model_frame") in ("true", "1"):
            outer = "__model__"
        if outer:
            direction = pose.axes.T @ self.pose(self.named(outer, scope)).axes @ direction
        pose = pose.at((0, 0, 0), axes_along(direction))
        parent, child = map(self.body, self.ends(record, scope))
        self.join(Joint(name, "", parent, child, pose, pose), record, axis)
        for mimic in (*record.all("mimic"), *axis.all("mimic")):
            offset, reference = mimic.number("offset", 0.0), mimic.number("reference", 0.0)
            factor = mimic.number("multiplier", 1.0)
            leading = self.named(mimic.get("joint"), scope)
            law = (offset - factor * reference, factor)
            self.assembly.ratios.append(Ratio(f"mimic_{name}", leading, name, law))

    def _loop(self, record: Record) -> None:
        """Add the joint that closes a loop, between two places of two links."""
        ends = [record.first("link1"), record.first("link2")]
        first, second = (self.body(end.get("link")) for end in ends)
        axis = record.first("axis")
        turn = axes_along(unit(axis.numbers("xyz", 3, "1 0 0"), record.where))
        pose, second_pose = (
            self.pose(end.get("link"))
            .at(end.numbers("xyz", 3, "0 0 0"), roll_pitch_yaw(end.numbers("rpy", 3, "0 0 0")))
            .at((0, 0, 0), turn)
            for end in ends
        )
        joint = Joint(record.get("name"), "", first, second, pose, second_pose)
        self.join(joint, record, axis)

    def join(self, joint: Joint, record: Record, axis: Record) -> None:
        """Add a joint, whose axis has limits and dynamics in it or beside it."""
        name, kind = joint.name, record.get("type")
        if kind not in KINDS:
            raise wrong(record.where, f"it is a {kind or 'joint of no type'}", f"{listed(KINDS)}")
        of_axis = axis if axis.tag == "axis" and axis.all("limit", "dynamics") else record
        limit, dynamics = of_axis.first("limit"), of_axis.first("dynamics")
        limits = (_bound(limit, "lower", FREE[0]), _bound(limit, "upper", FREE[1]))
        limits = limits if kind != "continuous" and limits[0] < limits[1] else FREE
        if dynamics.number("friction", 0.0):
            self.assembly.drawing.note(f"friction of joint {name}: left out")
        stiffness = dynamics.number("spring_stiffness", 0.0)
        rest, damping = dynamics.number("spring_reference", 0.0), dynamics.number("damping", 0.0)
        if kind == "gearbox":  # against a body that both turn on
            record.get("gearbox_reference_body")
            sizes = (record.number("gearbox_ratio", 1.0), 1.0)
            self.assembly.drawing.wheels.append(Wheels(name, joint.first, joint.second, sizes))
            return
        joint = joint._replace(kind=KINDS[kind], limits=limits, stiffness=stiffness)
        self.assembly.join(joint._replace(rest=rest, damping=damping))

    def _drive(self, record: Record) -> None:
        """Drive the joints of a transmission, or those that ros2_control commands."""
        joints = record.all("joint")
        if record.tag == "ros2_control":
            joints = [joint for joint in joints if joint.all("command_interface")]
        record.skip()
        for name in {joint.get("name") for joint in joints} & self.assembly.joints.keys():
            if self.assembly.joints[name].kind in ("pin", "slide"):
                self.assembly.change(name, law={})


def _bound(limit: Record, key: str, default: float) -> float:
    """A bound of a coordinate, which may be infinite."""
    infinite = limit.get(key).strip().lower().lstrip("+-") in ("inf", "infinity")
    return default if infinite else limit.number(key, default)


def _placed(record: Record, outer: Pose) -> Pose:
    """A pose by a place and angles, of SDF maybe in degrees, or a quaternion."""
    if origin := next(iter(record.all("origin")), None):
        turn = roll_pitch_yaw(origin.numbers("rpy", 3, "0 0 0"))
        return outer.at(origin.numbers("xyz", 3, "0 0 0"), turn)
    element = record.first("pose")
    if element.get("rotation_format") == "quat_xyzw":
        *position, x, y, z, w = record.numbers("pose", 7)
        return outer.at(position, quaternion((w, x, y, z), element.where))
    numbers = record.numbers("pose", 6, "0 0 0 0 0 0")
    unit_ = math.pi / 180 if element.get("degrees") in ("true", "1") else 1.0
    return outer.at(numbers[:3], roll_pitch_yaw([unit_ * x for x in numbers[3:]]))


# -- URDF ----------------------------------------------------------------------------------


def read_urdf(text: str, where: str) -> Drawing:
    """The drawing of a robot, all its coordinates at zero."""
    root = xml_of(text, where)
    if "<xacro:" in text:
        remedy = "expand it: xacro FILE > robot.urdf"
        raise wrong(where, "it is a xacro, which stands for a robot", "URDF", remedy)
    robot = _Robot(where, root.get("name"), "URDF file")
    robot.links = {record.get("name"): record for record in root.all("link")}
    for part in root.all("joint"):
        parent, child = robot.ends(part)
        if unknown := [link for link in (parent, child) if link not in robot.links]:
            raise wrong(where, f"no link {listed(unknown)}", f"links: {listed(robot.links)}")
        if child in robot.bases:
            raise wrong(where, "a link is the child of two joints", "a tree; loops by loop_joint")
        robot.joints[child] = part, ""
        robot.bases[child] = part, parent, ""
    robot.frame |= robot.links.keys() - robot.bases.keys()
    robot.poses |= {name: Pose() for name in robot.frame}
    for gazebo in root.all("gazebo"):
        gazebo.get("reference")
        for part in gazebo.all("joint"):
            key = numbered_name(f"{part.get('name')} of gazebo", robot.bases)
            robot.joints[key] = part, ""
            robot.bases[key] = part, robot.ends(part)[1], ""
    return robot.project(root, 0.0, "1 0 0", [0.0, 0.0, -9.81])


# -- SDF -----------------------------------------------------------------------------------


def read_sdf(text: str, where: str) -> Drawing:
    """The drawing of the models of a file, which may stand in each other."""
    root = xml_of(text, where)
    worlds = [root, *root.all("world")]
    models = [model for outer in worlds for model in outer.all("model")]
    if not models:
        raise wrong(where, "it has no model", "<sdf> with a <model>")
    movable = [m for m in models if m.get("static") not in ("true", "1")] or models
    name = movable[0].get("name")
    robot = _Robot(where, name, "SDF file", f"{name}::")
    robot.axes_of_models = tuple(map(int, re.findall(r"\d+", root.get("version")))) < (1, 5)
    for world in worlds:
        _enter(robot, world, "", WORLD)
    _hold(robot)
    gravity = next((w.numbers("gravity", 3) for w in worlds if w.get("gravity")), None)
    return robot.project(root, 1.0, "0 0 1", gravity or [0.0, 0.0, -9.8])


def _enter(robot: _Robot, model: Record, scope: str, base: str) -> None:
    """Collect a model or world, what stands in it in a scope, on its base."""
    for link in model.all("link"):
        name = robot.named(link.get("name"), scope)
        robot.links[name], robot.bases[name] = link, (link, base, scope)
        if model.get("static") in ("true", "1"):
            robot.frame.add(name)
    for joint in model.all("joint"):
        name = robot.named(joint.get("name"), scope)
        robot.joints[name] = joint, scope
        robot.bases[name] = joint, robot.ends(joint, scope)[1], scope
    for frame in model.all("frame"):
        frame.skip()  # nothing may stand on it
        attached = robot.named(frame.get("attached_to"), scope) or base
        robot.bases[robot.named(frame.get("name"), scope)] = frame, attached, scope
    for inner in model.all("model"):
        prefix = f"{scope}{inner.get('name')}::"
        name = robot.named("__model__", prefix)
        robot.bases[name] = inner, base, scope
        _enter(robot, inner, prefix, name)


def _hold(robot: _Robot) -> None:
    """Hold the first link of each mechanism that is not joined to the world."""
    joints = robot.joints.values()
    ends = [set(map(robot.body, robot.ends(joint, scope))) for joint, scope in joints]
    grounded = {FRAME}
    for link in robot.links:
        while touching := [pair for pair in ends if pair & grounded and not pair <= grounded]:
            grounded.update(*touching)
        if robot.body(link) not in grounded and any(link in pair for pair in ends):
            sentence = f"no link is joined to the world: {link} is taken as the frame"
            robot.assembly.drawing.note(sentence)
            robot.frame.add(link)
            grounded.add(link)


URDF = Reader(
    "URDF: a planar robot of ROS", (".urdf",), lambda text: "<robot" in text[:2000], read_urdf
)
SDF = Reader(
    "SDF: a planar model of Gazebo", (".sdf",), lambda text: "<sdf" in text[:2000], read_sdf
)
