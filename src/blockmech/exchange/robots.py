"""URDF and SDF: planar machines of ROS and Gazebo, a tree of links and what closes its loops.

Links are joined by revolute, continuous, prismatic and fixed joints; the root of URDF, and of SDF
what is joined to ``world`` or else the first link, is the frame. ``mimic`` and ``gearbox`` couple
coordinates. URDF closes no loop itself: ``loop_joint``, or an SDF joint in a ``gazebo`` element
does. Nothing in the files is driven, unless a ``transmission`` names its joint.

Sources: ROS wiki, urdf/XML; sdformat.org, specification 1.11.
"""

from __future__ import annotations

import numpy as np

from blockmech.exchange.drawing import FRAME, FREE, Drawing, Ratio, Wheels
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import Record, record_of, wrong, xml_of
from blockmech.exchange.spatial import Assembly, Joint, Mass, Pose, along, roll_pitch_yaw, unit
from blockmech.ground.errors import listed
from blockmech.ground.values import free_name

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
LOOKS = {
    "visual",
    "collision",
    "material",
    "sensor",
    "plugin",
    "name",
    "version",
    "safety_controller",
}
LOOKS |= {"calibration", "self_collide", "light", "scene", "physics", "gui", "effort", "velocity"}
LOOKS |= {"audio_source", "projector", "wind", "enable_wind", "allow_auto_disable", "stiffness"}
LOOKS |= {"dissipation", "xmlns", "provide_feedback", "kinematic", "gravity", "canonical_link"}
LOOKS |= {"magnetic_field", "atmosphere", "spherical_coordinates", "state", "hardwareInterface"}
LOOKS |= {"actuator", "type"}


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

    def mass(self, record: Record, pose: Pose, link: str) -> None:
        """The inertial element of a link; its origin stands in ``pose``."""
        tensor = record.one("inertia")
        xx, xy, xz, yy, yz, zz = (
            tensor.number(f"i{key}", 0.0) for key in ("xx", "xy", "xz", "yy", "yz", "zz")
        )
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        outer = record.one("mass")
        mass = outer.number("value", 0.0) if "value" in outer.fields else record.number("mass", 0.0)
        body = Mass(mass, pose.place, pose.axes @ inertia @ pose.axes.T)
        if link != FRAME and (mass or inertia.any()):
            self.assembly.masses[link].append(body)

    def joint(
        self, record: Record, ends: tuple[str, str], pose: Pose, second: Pose, axis: Record
    ) -> None:
        """A joint at a pose, whose axis record has limits and dynamics in it or beside it."""
        name, kind = record.get("name"), record.get("type")
        if kind not in KINDS:
            raise wrong(record.where, f"it is a {kind or 'joint of no type'}", f"{listed(KINDS)}")
        of_axis = axis if axis.tag == "axis" and axis.all("limit", "dynamics") else record
        limit, dynamics = of_axis.one("limit"), of_axis.one("dynamics")
        limits = (limit.number("lower", FREE[0]), limit.number("upper", FREE[1]))
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
        joint = Joint(name, KINDS[kind], *ends, pose, second, limits=limits, stiffness=stiffness)
        self.assembly.joints.append(joint._replace(rest=rest, damping=damping))

    def mimic(self, record: Record, name: str, leading: str) -> None:
        """A coordinate that follows another one in proportion."""
        offset, reference = record.number("offset", 0.0), record.number("reference", 0.0)
        factor = record.number("multiplier", 1.0)
        law = (offset - factor * reference, factor)
        self.assembly.ratios.append(Ratio(f"mimic_{name}", leading, name, law))

    def drawn(self, root: Record, gravity: list[float]) -> Drawing:
        """The drawing, with what was not read among its notes."""
        self.assembly.gravity = np.array(gravity)
        drawing = self.assembly.drawn()
        for sentence in root.left_over(LOOKS):
            drawing.note(sentence)
        return drawing


# -- URDF ----------------------------------------------------------------------------------


def read_urdf(text: str, where: str) -> Drawing:
    """The drawing of a robot, all its coordinates at zero."""
    root = record_of(xml_of(text, where), where)
    tree = _Tree(where, root.get("name"), "URDF file")
    links = {record.get("name"): record for record in root.all("link")}
    joints = root.all("joint")
    ends = {id(j): (j.one("parent").get("link"), j.one("child").get("link")) for j in joints}
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
            tree.mass(inertial, _origin(inertial, pose), name)
    for joint in joints:
        parent, child = ends[id(joint)]
        axis = joint.one("axis")
        turn = along(unit(axis.numbers("xyz", 3, "1 0 0"), joint.where))
        pose = placed(child).at((0, 0, 0), turn)
        tree.joint(joint, (tree.body(parent), tree.body(child)), pose, pose, axis)
        for mimic in joint.all("mimic"):
            tree.mimic(mimic, joint.get("name"), mimic.get("joint"))
    for loop in root.all("loop_joint"):
        _loop(loop, tree)
    for gazebo in root.all("gazebo"):
        gazebo.get("reference")
        for joint in gazebo.all("joint"):
            _sdf_joint(joint, tree, {})
    for transmission in root.all("transmission"):
        _transmission(transmission, tree)
    return tree.drawn(root, [0.0, 0.0, -9.81])


def _origin(record: Record, outer: Pose) -> Pose:
    origin = record.one("origin")
    turn = roll_pitch_yaw(origin.numbers("rpy", 3, "0 0 0"))
    return outer.at(origin.numbers("xyz", 3, "0 0 0"), turn)


def _loop(record: Record, tree: _Tree) -> None:
    """A joint between two places of two links."""
    ends = [record.one("link1"), record.one("link2")]
    bodies = [tree.body(end.get("link")) for end in ends]
    axis = record.one("axis")
    turn = along(unit(axis.numbers("xyz", 3, "1 0 0"), record.where))
    poses = [
        tree.poses[end.get("link")]
        .at(end.numbers("xyz", 3, "0 0 0"), roll_pitch_yaw(end.numbers("rpy", 3, "0 0 0")))
        .at((0, 0, 0), turn)
        for end in ends
    ]
    tree.joint(record, (bodies[0], bodies[1]), poses[0], poses[1], axis)


def _transmission(record: Record, tree: _Tree) -> None:
    driven = {joint.get("name") for joint in record.all("joint")}
    joints = tree.assembly.joints
    for k, joint in enumerate(joints):
        if joint.name in driven and joint.kind in ("pin", "slide"):
            joints[k] = joint._replace(law={})


# -- SDF -----------------------------------------------------------------------------------


def read_sdf(text: str, where: str) -> Drawing:
    """The drawing of the first model of a file."""
    root = record_of(xml_of(text, where), where)
    worlds = [root, *root.all("world")]
    models = [model for outer in worlds for model in outer.all("model")]
    if not models:
        raise wrong(where, "it has no model", "<sdf> with a <model>")
    model, *more = models
    tree = _Tree(where, model.get("name"), "SDF file")
    if more:
        names = listed([other.get("name") for other in more])
        tree.assembly.drawing.note(f"models {names}: left out, a drawing is of one")
        for other in more:
            other.skip()
    links = {record.get("name"): record for record in model.all("link")}
    joints = {record.get("name"): record for record in model.all("joint")}
    frames = {record.get("name"): record for record in model.all("frame")}
    base = Pose()
    if model.get("pose"):
        base = _pose(model, Pose())
    tree.poses["__model__"] = base
    placed: dict[str, Pose] = {WORLD: Pose(), "": base, "__model__": base}

    def pose_of(name: str, depth: int = 0) -> Pose:
        record = links.get(name) or joints.get(name) or frames.get(name)
        if name in placed:
            return placed[name]
        if record is None or depth > 100:
            known = f"names: {listed([*links, *joints, *frames])}"
            raise wrong(where, f"no link, joint or frame {name[:40]}", known)
        default = record.get("child") if name in joints else record.get("attached_to")
        outer = record.one("pose").get("relative_to") or default
        placed[name] = _pose(record, pose_of(outer, depth + 1))
        return placed[name]

    static = model.get("static") in ("true", "1")
    ends = [(j.get("parent"), j.get("child")) for j in joints.values()]
    if not static and not any(WORLD in pair for pair in ends):
        first = next(iter(links), "")
        tree.assembly.drawing.note(f"no link is joined to the world: {first} is taken as the frame")
        tree.frame.add(first)
    for name, record in links.items():
        tree.poses[name] = pose_of(name)
        body = tree.body(name)
        if body != FRAME:
            tree.assembly.masses[body] = []
        for inertial in record.all("inertial"):
            tree.mass(inertial, _pose(inertial, tree.poses[name]), body)
    for record in joints.values():
        _sdf_joint(record, tree, placed | {name: pose_of(name) for name in joints})
    gravity = next((w.numbers("gravity", 3) for w in worlds if w.get("gravity")), None)
    return tree.drawn(root, gravity or [0.0, 0.0, -9.8])


def _pose(record: Record, outer: Pose) -> Pose:
    numbers = record.numbers("pose", 6, "0 0 0 0 0 0")
    return outer.at(numbers[:3], roll_pitch_yaw(numbers[3:]))


def _sdf_joint(record: Record, tree: _Tree, poses: dict[str, Pose]) -> None:
    """A joint of SDF, also one in a gazebo element of URDF, whose pose is that in its child."""
    parent, child = (record.get(key) or record.one(key).get("link") for key in ("parent", "child"))
    one, two = tree.body(parent), tree.body(child)
    name = record.get("name")
    pose = poses.get(name) or _pose(record, tree.poses[child])
    axis = record.one("axis")
    xyz = axis.one("xyz")
    direction = unit(axis.numbers("xyz", 3, "0 0 1"), record.where)
    if expressed := xyz.get("expressed_in"):
        outer = tree.poses.get(expressed) or poses.get(expressed, pose)
        direction = pose.axes.T @ outer.axes @ direction
    elif axis.get("use_parent_model_frame") in ("true", "1"):
        direction = pose.axes.T @ tree.poses.get("__model__", Pose()).axes @ direction
    pose = pose.at((0, 0, 0), along(direction))
    tree.joint(record, (one, two), pose, pose, axis)
    for mimic in axis.all("mimic"):
        tree.mimic(mimic, name, mimic.get("joint"))


URDF = Reader(
    "URDF: a planar robot of ROS", (".urdf",), lambda text: "<robot" in text[:2000], read_urdf
)
SDF = Reader(
    "SDF: a planar model of Gazebo", (".sdf",), lambda text: "<sdf" in text[:2000], read_sdf
)
