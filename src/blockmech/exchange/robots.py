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
from blockmech.exchange.parsing import Record, record_of, wrong, xml_of
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
from blockmech.ground.names import free_name

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


class _Tree:
    """Links with their poses, and joints between them."""

    def __init__(self, where: str, name: str, source: str) -> None:
        self.where = where
        self.assembly = Assembly(where, Drawing(name or "robot", "m", source))
        self.poses: dict[str, Pose] = {WORLD: Pose()}
        self.frame = {WORLD}

    def body(self, name: str) -> str:
        """A link as the drawing calls it. Raises `FormatError` for one that there is not."""
        if name not in self.poses:
            raise wrong(self.where, f"no link {name[:40]}", f"links: {listed(self.poses)}")
        if name in self.frame:
            return FRAME
        return free_name(name, {FRAME})

    def mass(self, record: Record, pose: Pose, link: str, default: float) -> None:
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

    def joint(
        self,
        record: Record,
        name: str,
        ends: tuple[str, str],
        poses: tuple[Pose, Pose],
        axis: Record,
    ) -> None:
        """A joint at its poses, whose axis record has limits and dynamics in it or beside it."""
        kind = record.get("type")
        if kind not in KINDS:
            raise wrong(record.where, f"it is a {kind or 'joint of no type'}", f"{listed(KINDS)}")
        of_axis = axis if axis.tag == "axis" and axis.all("limit", "dynamics") else record
        limit, dynamics = of_axis.first("limit"), of_axis.first("dynamics")
        limits = (_bound(limit, "lower", FREE[0]), _bound(limit, "upper", FREE[1]))
        limits = limits if kind != "continuous" and limits[0] < limits[1] else FREE
        friction = dynamics.number("friction", 0.0)
        if friction:
            self.assembly.drawing.note(f"friction of joint {name}: left out")
        stiffness = dynamics.number("spring_stiffness", 0.0)
        rest, damping = dynamics.number("spring_reference", 0.0), dynamics.number("damping", 0.0)
        if kind == "gearbox":  # against a body that both turn on
            record.get("gearbox_reference_body")
            sizes = (record.number("gearbox_ratio", 1.0), 1.0)
            self.assembly.drawing.wheels.append(Wheels(name, *ends, sizes))
            return
        joint = Joint(name, KINDS[kind], *ends, *poses, limits=limits, stiffness=stiffness)
        self.assembly.join(joint._replace(rest=rest, damping=damping))

    def mimic(self, record: Record, name: str, leading: str) -> None:
        """A coordinate that follows another one in proportion."""
        offset, reference = record.number("offset", 0.0), record.number("reference", 0.0)
        factor = record.number("multiplier", 1.0)
        law = (offset - factor * reference, factor)
        self.assembly.ratios.append(Ratio(f"mimic_{name}", leading, name, law))


def _bound(limit: Record, key: str, default: float) -> float:
    """A bound of a coordinate, which may be infinite."""
    infinite = limit.get(key).strip().lower().lstrip("+-") in ("inf", "infinity")
    return default if infinite else limit.number(key, default)


# -- URDF ----------------------------------------------------------------------------------


def read_urdf(text: str, where: str) -> Drawing:
    """The drawing of a robot, all its coordinates at zero."""
    root = record_of(xml_of(text, where), where)
    if "<xacro:" in text:
        remedy = "expand it: xacro FILE > robot.urdf"
        raise wrong(where, "it is a xacro, which stands for a robot", "URDF", remedy)
    tree = _Tree(where, root.get("name"), "URDF file")
    links = {record.get("name"): record for record in root.all("link")}
    joints = root.all("joint")
    ends = {id(j): (j.first("parent").get("link"), j.first("child").get("link")) for j in joints}
    for pair in ends.values():
        if unknown := [link for link in pair if link not in links]:
            raise wrong(where, f"no link {listed(unknown)}", f"links: {listed(links)}")
    above = {child: (parent, joint) for joint in joints for parent, child in [ends[id(joint)]]}
    if len(above) < len(joints):
        raise wrong(where, "a link is the child of two joints", "a tree; loops by loop_joint")
    tree.frame |= {link for link in links if link not in above}

    def placed(link: str, depth: int = 0) -> Pose:
        if link not in tree.poses:
            if depth > len(links):
                raise wrong(where, "its joints go round in a circle", "a tree of links")
            parent, joint = above.get(link, (WORLD, Record("", {}, [], where)))
            tree.poses[link] = _origin(joint, placed(parent, depth + 1))
        return tree.poses[link]

    for link, record in links.items():
        pose, name = placed(link), tree.body(link)
        if name != FRAME:
            tree.assembly.masses[name] = []
        for inertial in record.all("inertial"):
            tree.mass(inertial, _origin(inertial, pose), name, 0.0)
    for joint in joints:
        parent, child = ends[id(joint)]
        axis = joint.first("axis")
        turn = axes_along(unit(axis.numbers("xyz", 3, "1 0 0"), joint.where))
        pose = placed(child).at((0, 0, 0), turn)
        name = joint.get("name")
        tree.joint(joint, name, (tree.body(parent), tree.body(child)), (pose, pose), axis)
        for mimic in joint.all("mimic"):
            tree.mimic(mimic, name, mimic.get("joint"))
    for loop in root.all("loop_joint"):
        _loop(loop, tree)
    scopes = _Scopes(tree)
    for gazebo in root.all("gazebo"):
        gazebo.get("reference")
        scopes.joints |= {joint.get("name"): (joint, "") for joint in gazebo.all("joint")}
    for name in scopes.joints:
        _sdf_joint(name, scopes)
    for record in root.all("transmission", "ros2_control"):
        _drive(record, tree)
    tree.assembly.gravity = np.array([0.0, 0.0, -9.81])
    return tree.assembly.project(root, LOOKS)


def _origin(record: Record, outer: Pose) -> Pose:
    origin = record.first("origin")
    turn = roll_pitch_yaw(origin.numbers("rpy", 3, "0 0 0"))
    return outer.at(origin.numbers("xyz", 3, "0 0 0"), turn)


def _loop(record: Record, tree: _Tree) -> None:
    """A joint between two places of two links."""
    ends = [record.first("link1"), record.first("link2")]
    bodies = [tree.body(end.get("link")) for end in ends]
    axis = record.first("axis")
    turn = axes_along(unit(axis.numbers("xyz", 3, "1 0 0"), record.where))
    first, second = (
        tree.poses[end.get("link")]
        .at(end.numbers("xyz", 3, "0 0 0"), roll_pitch_yaw(end.numbers("rpy", 3, "0 0 0")))
        .at((0, 0, 0), turn)
        for end in ends
    )
    tree.joint(record, record.get("name"), (bodies[0], bodies[1]), (first, second), axis)


def _drive(record: Record, tree: _Tree) -> None:
    """Drive the joints of a transmission, or those that ros2_control commands."""
    joints = record.all("joint")
    if record.tag == "ros2_control":
        joints = [joint for joint in joints if joint.all("command_interface")]
    record.skip()
    for name in {joint.get("name") for joint in joints} & tree.assembly.joints.keys():
        if tree.assembly.joints[name].kind in ("pin", "slide"):
            tree.assembly.change(name, law={})


# -- SDF -----------------------------------------------------------------------------------


def read_sdf(text: str, where: str) -> Drawing:
    """The drawing of the models of a file, which may stand in each other."""
    root = record_of(xml_of(text, where), where)
    worlds = [root, *root.all("world")]
    models = [model for outer in worlds for model in outer.all("model")]
    if not models:
        raise wrong(where, "it has no model", "<sdf> with a <model>")
    movable = [m for m in models if m.get("static") not in ("true", "1")] or models
    tree = _Tree(where, movable[0].get("name"), "SDF file")
    scopes = _Scopes(tree, f"{movable[0].get('name')}::")
    scopes.axes_of_models = tuple(map(int, re.findall(r"\d+", root.get("version")))) < (1, 5)
    for world in worlds:
        scopes.enter(world, "", "")
    poses = {name: scopes.pose(name) for name in scopes.links}
    scopes.hold()
    for name, record in scopes.links.items():
        body = scopes.body(name)
        if body != FRAME:
            tree.assembly.masses[body] = []
        if record.get("gravity") in ("false", "0"):
            tree.assembly.drawing.note(f"gravity acts on {name}, too")
        inertial = record.first("inertial")
        tree.mass(inertial, _pose(inertial, poses[name]), body, 1.0)  # as SDF has it
    for name in scopes.joints:
        _sdf_joint(name, scopes)
    gravity = next((w.numbers("gravity", 3) for w in worlds if w.get("gravity")), None)
    tree.assembly.gravity = np.array(gravity or [0.0, 0.0, -9.8])
    return tree.assembly.project(root, LOOKS)


class _Scopes:
    """Links, joints and frames of models by their names, behind those of the outer models."""

    def __init__(self, tree: _Tree, main: str = "") -> None:
        """``main`` is the scope whose names stand alone."""
        self.tree, self.poses, self.main = tree, tree.poses, main
        self.axes_of_models = False  # whether axes are those of the model, as before SDF 1.5
        self.links: dict[str, Record] = {}
        self.joints: dict[str, tuple[Record, str]] = {}  # with their scope
        self.bases: dict[str, tuple[Record, str, str]] = {}  # and what they stand on

    def enter(self, model: Record, scope: str, base: str) -> None:
        """Collect a model or world, what stands in it in a scope, on its base."""
        base = base or WORLD
        for link in model.all("link"):
            name = self.named(link.get("name"), scope)
            self.links[name], self.bases[name] = link, (link, base, scope)
            if model.get("static") in ("true", "1"):
                self.tree.frame.add(name)
        for joint in model.all("joint"):
            name = self.named(joint.get("name"), scope)
            self.joints[name] = joint, scope
            self.bases[name] = joint, self.ends(name)[1], scope
        for frame in model.all("frame"):
            frame.skip()  # nothing may stand on it
            attached = self.named(frame.get("attached_to"), scope) or base
            self.bases[self.named(frame.get("name"), scope)] = frame, attached, scope
        for inner in model.all("model"):
            prefix = f"{scope}{inner.get('name')}::"
            self.bases[self.named("__model__", prefix)] = inner, base, scope
            self.enter(inner, prefix, self.named("__model__", prefix))

    def named(self, text: str, scope: str) -> str:
        """What a name in a scope is called in the drawing."""
        name = text if text in ("", WORLD) else f"{scope}{text}"
        return name.removeprefix(self.main)

    def ends(self, name: str) -> tuple[str, str]:
        """Parent and child of a joint."""
        joint, scope = self.joints[name]
        parent, child = (joint.get(x) or joint.first(x).get("link") for x in ("parent", "child"))
        return self.named(parent, scope), self.named(child, scope)

    def body(self, name: str) -> str:
        """What the drawing calls a link, or the one that a frame is attached to."""
        for _ in self.bases:
            if name not in self.bases or name in self.links:
                break
            name = self.bases[name][1]
        return self.tree.body(name)

    def pose(self, name: str, depth: int = 0) -> Pose:
        """Where something is. Raises `FormatError` for what there is not, and for circles."""
        if name not in self.poses:
            if name not in self.bases or depth > len(self.bases):
                valid = f"names: {listed([x for x in self.bases if '__model__' not in x])}"
                raise wrong(self.tree.where, f"no link, joint or frame {name[:40]}", valid)
            record, base, scope = self.bases[name]
            if relative := record.first("pose").get("relative_to"):
                base = self.named(relative, scope)
            self.poses[name] = _pose(record, self.pose(base, depth + 1))
        return self.poses[name]

    def hold(self) -> None:
        """Hold the first link of each mechanism that is not joined to the world."""
        ends = [set(map(self.body, self.ends(joint))) for joint in self.joints]
        grounded = {FRAME}
        for link in self.links:
            while touching := [pair for pair in ends if pair & grounded and not pair <= grounded]:
                grounded.update(*touching)
            if self.tree.body(link) not in grounded and any(link in pair for pair in ends):
                sentence = f"no link is joined to the world: {link} is taken as the frame"
                self.tree.assembly.drawing.note(sentence)
                self.tree.frame.add(link)
                grounded.add(link)


def _pose(record: Record, outer: Pose) -> Pose:
    """A pose by a place and angles, which may be degrees or a quaternion."""
    element = record.first("pose")
    if element.get("rotation_format") == "quat_xyzw":
        *position, x, y, z, w = record.numbers("pose", 7)
        return outer.at(position, quaternion((w, x, y, z), element.where))
    numbers = record.numbers("pose", 6, "0 0 0 0 0 0")
    unit_ = math.pi / 180 if element.get("degrees") in ("true", "1") else 1.0
    return outer.at(numbers[:3], roll_pitch_yaw([unit_ * x for x in numbers[3:]]))


def _sdf_joint(name: str, scopes: _Scopes) -> None:
    """A joint of SDF, also one in a gazebo element of URDF, whose pose is that in its child."""
    record, scope = scopes.joints[name]
    parent, child = scopes.ends(name)
    pose = scopes.pose(name) if name in scopes.bases else _pose(record, scopes.pose(child))
    axis = record.first("axis")
    direction = unit(axis.numbers("xyz", 3, "0 0 1"), record.where)
    outer = axis.first("xyz").get("expressed_in")
    if scopes.axes_of_models or axis.get("use_parent_model_frame") in ("true", "1"):
        outer = "__model__"
    if outer:
        direction = pose.axes.T @ scopes.pose(scopes.named(outer, scope)).axes @ direction
    pose = pose.at((0, 0, 0), axes_along(direction))
    ends = scopes.body(parent), scopes.body(child)
    scopes.tree.joint(record, name, ends, (pose, pose), axis)
    for mimic in axis.all("mimic"):
        scopes.tree.mimic(mimic, name, scopes.named(mimic.get("joint"), scope))


URDF = Reader(
    "URDF: a planar robot of ROS", (".urdf",), lambda text: "<robot" in text[:2000], read_urdf
)
SDF = Reader(
    "SDF: a planar model of Gazebo", (".sdf",), lambda text: "<sdf" in text[:2000], read_sdf
)
