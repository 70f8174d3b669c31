"""FreeCAD and Ondsel: assemblies ``.asmt`` whose parts move in one plane.

A text whose levels are tabs. Markers of the assembly are the frame's, a joint is between two
markers I and J, along or about their z axes. Of a gear pair z I turns by -radiusI / radiusJ; a rack
moves along its marker's x axis by the pitch radius times what the pinion turns about z. Motions
and limits are of the angle or the way from marker I to marker J, by formulas of time: sums,
products, powers (``^``), functions of one or two arguments, ``pi``; a ``d`` behind a number is of
another language and means nothing. They are read into a tree and computed, never run as a program.

Source: OndselSolver, ``ASMTAssembly.cpp`` (reading), ``GearConstraintIJ.cpp``,
``RackPinConstraintIJ.cpp``, ``ASMTLimit.cpp`` and its test assemblies.
"""

from __future__ import annotations

import ast
import cmath
import math
import operator
import re
from collections.abc import Callable

import numpy as np

from blockmech.exchange.drawing import FRAME, Drawing, Spring, Wheels
from blockmech.exchange.formats import Reader
from blockmech.exchange.parsing import Record, wrong
from blockmech.exchange.spatial import Assembly, Joint, Mass, Pose, orthonormal
from blockmech.ground.errors import FormatError
from blockmech.ground.limits import DEEPEST, MOST
from blockmech.ground.tolerances import EQUAL
from blockmech.typing import Data

MATHS = ["sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "exp", "log", "fabs"]
FUNCTIONS: dict[str, Callable[..., float]] = {name: getattr(math, name) for name in MATHS}
SAME = {"arcsin": "asin", "arccos": "acos", "arctan": "atan", "arctan2": "atan2", "abs": "fabs"}
SIGNS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}


class Formula:
    """A formula as a function of its variables; its sines stand apart.

    ``rIJ(self)`` is the variable ``rIJ``.
    """

    def __init__(self, text: str, where: str) -> None:
        """Raises `FormatError` for what is no formula."""
        self.where = where
        self.short = text if len(text) < 60 else f"{text[:57]}..."
        plain = re.sub(r"(\d\.?)d\b", r"\1", text.strip().strip('"')).replace("^", "**")
        try:
            self.root = ast.parse(plain[:MOST], mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise wrong(where, f"{self.short} cannot be read", "a formula of time") from None
        calls = [node for node in ast.walk(self.root) if isinstance(node, ast.Call)]
        self.waves = [node for node in calls if _name(node) in ("sin", "cos")]

    def __call__(self, **values: float) -> float:
        """Its value. Raises `FormatError` for names that are none, or where it is no number."""
        return self.value(self.root, values)

    def value(self, node: ast.AST, values: dict[str, float]) -> float:
        """The value of a part of it; that of a sine is ``wave``, where this is given."""
        try:
            number = float(self._value(node, values))
        except (ArithmeticError, ValueError, TypeError, RecursionError, KeyError):
            number = math.nan
        if not math.isfinite(number):
            raise wrong(self.where, f"{self.short} is no number", f"{', '.join(FUNCTIONS)}")
        return number

    def _value(self, node: ast.AST, values: dict[str, float]) -> float:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return float(number)
            case ast.Name(id=name):
                return math.pi if name == "pi" else values[name]
            case ast.UnaryOp(op=op, operand=inner):
                return SIGNS[type(op)](self._value(inner, values))
            case ast.BinOp(left=one, op=op, right=two):
                return SIGNS[type(op)](self._value(one, values), self._value(two, values))
            case ast.Call(args=[ast.Name(id="self")]):
                return values[_name(node)]
            case ast.Call(args=arguments, keywords=[]):
                if node in self.waves and "wave" in values:
                    return values["wave"]
                return FUNCTIONS[_name(node)](*(self._value(x, values) for x in arguments))
        raise KeyError


def _name(call: ast.Call) -> str:
    name = call.func.id if isinstance(call.func, ast.Name) else ""
    return SAME.get(name, name)


def law_of(formula: Formula, end: float, turns: bool) -> Data:
    """The law of motion of a formula of ``time``, or a table until ``end`` [s].

    A constant rate that ``turns`` does so once.
    """
    times = (0.0, 0.5, 1.0, 0.31, 1.7)
    q = [formula(time=t) for t in times]
    rate, curve = q[2] - q[0], 4 * (q[0] - 2 * q[1] + q[2])
    size = max(map(abs, q)) or 1.0
    first = rate - curve / 2
    bent = max(abs(q[0] + first * t + curve * t * t / 2 - x) for t, x in zip(times, q, strict=True))
    if bent < EQUAL * size and abs(curve) < EQUAL * size:
        travel = math.copysign(math.tau, rate) if turns and rate else rate * end
        return {"law": "constant_rate", "rate": rate, "from": q[0], "to": q[0] + travel}
    if len(formula.waves) == 1 and (wave := _harmonic(formula)) is not None:
        return wave
    if bent < EQUAL * size:
        to = q[0] + first * end + curve * end * end / 2
        law = {"law": "rate_acceleration", "rate": first, "acceleration": curve}
        return {**law, "from": q[0], "to": to}
    rows = [end * k / 240 for k in range(241)]
    return {"law": "trajectory", "times": rows, "values": [formula(time=t) for t in rows]}


def _harmonic(formula: Formula) -> Data | None:
    """mean + amplitude sin(w t + phase), None for what has other numbers at other times."""
    wave = formula.waves[0]
    times = (0.0, 1.0, 0.37)
    a, b, c = (formula.value(wave.args[0], {"time": t}) for t in times)
    low, high = ([formula(time=t, wave=w) for t in times] for w in (0.0, 1.0))
    w, size = b - a, max(map(abs, [*low, *high])) or 1.0
    bent = max(abs(a + 0.37 * w - c), max(low) - min(low), max(high) - min(high))
    if not w or bent > EQUAL * max(size, abs(a), abs(b)):
        return None
    if _name(wave) == "cos":
        a += math.pi / 2
    amplitude, sign = high[0] - low[0], math.copysign(1.0, w)
    law = {"law": "harmonic", "mean": low[0], "amplitude": sign * amplitude}
    return {**law, "frequency": abs(w) / math.tau, "phase": sign * a}


KINDS = {
    "RevoluteJoint": "pin",
    "SphericalJoint": "ball",
    "CylindricalJoint": "cylinder",
    "TranslationalJoint": "slide",
    "FixedJoint": "weld",
    "PlanarJoint": "flat",
    "PointInPlaneJoint": "slot",
    "LineInPlaneJoint": "slot",
    "PointInLineJoint": "line",
    "SphSphJoint": "bar",
    "RevRevJoint": "rod",
    "RevCylJoint": "rod",
}
ALWAYS = ("ParallelAxesJoint",)  # of parts that move in the plane anyhow
COUPLINGS = ("GearJoint", "RackPinionJoint")
LOOKS = {"hmin", "hmax", "hout", "errorTol", "iterMax", "corAbsTol", "corRelTol", "intAbsTol"}
LOOKS |= {"intRelTol", "iterMaxPosKine", "iterMaxAccKine", "errorTolPosKine", "errorTolAccKine"}
LOOKS |= {"SimulationParameters", "AnimationParameters", "RefCurves", "RefSurfaces", "Notes"}
LOOKS |= {"FeatureOrder", "Parts", "KinematicIJs", "IsFixed", "Tol"}
LOOKS |= {"Velocity3D", "Omega3D", "DegreesOfFreedom", "GeneralConstraintSets", "coeffRestitution"}


def _records(text: str, where: str) -> Record:
    root = Record("", {}, [], where)
    stack = [root]
    for k, raw in enumerate(re.split(r"^TimeSeries", text, flags=re.MULTILINE)[0].splitlines(), 1):
        if not raw.strip():
            continue
        if k > MOST:
            raise wrong(where, f"more than {MOST} lines", "a smaller assembly")
        depth = len(raw) - len(raw.lstrip("\t"))
        if depth >= DEEPEST:
            raise wrong(f"{where}, line {k}", "levels too deep in each other")
        if depth >= len(stack):
            raise wrong(f"{where}, line {k}", "it is deeper than a level below the last", "tabs")
        del stack[depth + 1 :]
        record = Record(raw.strip(), {}, [], f"{where}, line {k}")
        stack[-1].inner.append(record)
        stack[-1].text = f"{stack[-1].text}\n{record.tag}".strip()
        stack.append(record)
    return root


def _pose(record: Record, outer: Pose) -> Pose:
    axes = np.array(record.numbers("RotationMatrix", 9)).reshape(3, 3)
    where = f"{record.where}, RotationMatrix"
    return outer.at(record.numbers("Position3D", 3), orthonormal(axes, where))


def read(text: str, where: str) -> Drawing:
    """The drawing of an assembly as it is saved."""
    root = next(iter(_records(text, where).all("Assembly")), None)
    if root is None:
        raise wrong(where, "it has no Assembly", "an assembly of FreeCAD or OndselSolver")
    return _Reading(root, where).read()


class _Reading:
    def __init__(self, root: Record, where: str) -> None:
        self.root, self.where, self.name = root, where, root.get("Name")
        drawing = Drawing(self.name or "assembly", source="FreeCAD assembly")
        self.assembly = Assembly(where, drawing)
        self.markers: dict[str, tuple[str, Pose]] = {}  # path -> body, where it is
        times = root.first("SimulationParameters")
        self.end = (times.number("tend", 0.0) - times.number("tstart", 0.0)) or 1.0
        root.get("Position3D")
        root.get("RotationMatrix")

    def read(self) -> Drawing:
        """The drawing, with what was not read among its notes."""
        root, assembly = self.root, self.assembly
        self._markers(root, f"/{self.name}", FRAME, Pose())
        for part in root.below("Parts"):
            if part.tag == "Part":
                self._part(part)
        sets = root.first("ConstraintSets")
        joints = sorted(sets.below("Joints"), key=lambda record: record.tag in COUPLINGS)
        for record in joints:
            self._joint(record)
        for record in sets.below("Motions"):
            self._motion(record)
        for record in sets.below("Limits"):
            self._limit(record)
        for record in root.below("ForceTorques"):
            self._force(record)
        if root.all("ConstantGravity"):
            assembly.gravity = np.array(root.numbers("ConstantGravity", 3))
        return assembly.project(root, LOOKS)

    def _markers(self, owner: Record, path: str, body: str, base: Pose) -> None:
        for point in owner.below("RefPoints"):
            at = _pose(point, base)
            for marker in point.below("Markers"):
                self.markers[f"{path}/{marker.get('Name')}"] = body, _pose(marker, at)

    def _part(self, part: Record) -> None:
        name, masses = part.get("Name"), list[Mass]()
        if not name or name in self.assembly.masses or name == FRAME:
            raise wrong(part.where, f'a part is named "{name}"', "names of their own")
        pose = _pose(part, Pose())
        self.assembly.masses[name] = masses
        self._markers(part, f"/{self.name}/{name}", name, pose)
        for body in part.all("PrincipalMassMarker"):
            body.get("Density")
            at = _pose(body, pose)
            self.markers[f"/{self.name}/{name}/{body.get('Name') or 'MassMarker'}"] = name, at
            moments = np.diag(body.numbers("MomentOfInertias", 3, "0 0 0"))
            mass = body.number("Mass", 0.0)
            masses.append(Mass(mass, at.origin, at.axes @ moments @ at.axes.T))

    def _ends(self, record: Record) -> list[tuple[str, Pose]]:
        if joint := record.get("MotionJoint"):
            match = self.assembly.joints.get(joint.rpartition("/")[2])
            if match is None:
                return []
            return [(match.first, match.pose), (match.second, match.second_pose)]
        names = [record.get("MarkerI"), record.get("MarkerJ")]
        for name in names:
            if name not in self.markers:
                at = f"{record.where}, {record.get('Name') or record.tag}"
                raise wrong(at, f'no marker "{name}"', "markers of the assembly and its parts")
        return [self.markers[name] for name in names]

    def _joint(self, record: Record) -> None:
        assembly = self.assembly
        name = record.get("Name") or f"joint_{len(assembly.joints) + 1}"
        kind = KINDS.get(record.tag, "")
        if not kind and record.tag not in COUPLINGS:
            if record.tag not in ALWAYS:
                assembly.drawing.note(f"{record.tag} {name}: left out")
            record.skip()
            return
        if record.tag in COUPLINGS:
            self._couple(record, name)
            return
        (first, pose), (second, second_pose) = self._ends(record)
        if first != second:
            if kind in ("flat", "slot"):  # the face is marker J's, and may be shifted along z
                first, pose, second, second_pose = second, second_pose, first, pose
                offset = pose.axes[:, 2] * record.number("offset", 0.0)
                pose = Pose(pose.origin + offset, pose.axes)
            elif kind in ("bar", "rod"):
                record.number("distanceIJ", 0.0)
            zero = _angle(pose, second_pose)
            assembly.join(Joint(name, kind, first, second, pose, second_pose, zero))
            record.get("constantIJ")

    def _couple(self, record: Record, name: str) -> None:
        """A pair of gears, or a rack that moves along its marker's x axis."""
        assembly, (first, second) = self.assembly, self._ends(record)
        if record.tag == "GearJoint":
            sizes = (record.number("radiusI"), record.number("radiusJ"))
            if not all(sizes):
                raise wrong(record.where, f"{name} has a radius of 0", "radii of both wheels")
            for _, pose in (first, second):
                assembly.sense(pose, record.where)
            assembly.drawing.wheels.append(Wheels(name, first[0], second[0], sizes))
            return
        pins = (j for j in assembly.joints.values() if j.kind == "pin")
        turning = {x for j in pins for x in (j.first, j.second)}
        rack, pinion = (
            (second, first) if first[0] in turning and second[0] not in turning else (first, second)
        )
        radius = record.number("pitchRadius") * assembly.sense(pinion[1], record.where)
        angle = cmath.phase(assembly.flat(rack[1].axes[:, 0]) * math.copysign(1.0, radius))
        wheels = Wheels(name, pinion[0], rack[0], (abs(radius), 1.0), rack=angle)
        assembly.drawing.wheels.append(wheels)

    def _motion(self, record: Record) -> None:
        drawing, name = self.assembly.drawing, record.get("Name")
        turns = record.tag == "RotationalMotion"
        if record.tag == "GeneralMotion":
            self._general_motion(record, name)
            return
        if record.tag not in ("RotationalMotion", "TranslationalMotion"):
            drawing.note(f"{record.tag} {name}: left out")
            record.skip()
            return
        text = record.get("RotationZ" if turns else "TranslationZ")
        if joint := self._moved(record):
            self.assembly.change(joint, law=self._law(record, text, turns))
        else:
            drawing.note(f"{name} moves no joint that there is: left out")

    def _law(self, record: Record, text: str, turns: bool) -> Data:
        """The law of motion of a formula, none where it is none of time."""
        drawing, name = self.assembly.drawing, record.get("Name")
        try:
            law = law_of(Formula(text, f"{record.where}, {name}"), self.end, turns)
        except FormatError as error:
            drawing.note(f"{name}: {error.problems[0].found}: it is driven without a law")
            return {}
        if law.get("law") == "trajectory":
            drawing.note(f"{name}: {text[:60]} is a table of {self.end:g} s here")
        return law

    def _general_motion(self, record: Record, name: str) -> None:
        """A marker's place and angle in the axes of another: two slides and a pin."""
        assembly, ((body, base), (last, marker)) = self.assembly, self._ends(record)
        normal = int(abs(assembly.plane[0] @ base.axes).argmax())
        turning = record.numbers("RotationOrder", 3, "1 2 3").index(normal + 1)
        out = [f"rIJI{normal + 1}", *(f"angIJJ{k + 1}" for k in range(3) if k != turning)]
        for key in out:
            if self._law(record, record.get(key), False).get("rate") != 0:
                assembly.drawing.note(f"{name}: {key} leaves the plane: left out")
        origin, offset = base.origin, base.axes.T @ (marker.origin - base.origin)
        *across, order = ([(k + 1) % 3, (k + 2) % 3, k % 3] for k in range(normal + 1, normal + 4))
        for axes in across:  # their last is the one along which it slides
            slider, basis = f"{name}_{axes[2] + 1}", base.axes[:, axes]
            law = self._law(record, record.get(f"rIJI{axes[2] + 1}"), False)
            start, end = Pose(origin, basis), Pose(origin + offset[axes[2]] * basis[:, 2], basis)
            assembly.masses[slider] = []
            assembly.join(Joint(slider, "slide", body, slider, start, end, law=law))
            body, origin = slider, end.origin
        start, end = (Pose(marker.origin, x.axes[:, order]) for x in (base, marker))
        law = self._law(record, record.get(f"angIJJ{turning + 1}"), True)
        pin = Joint(f"{name}_turn", "pin", body, last, start, end, _angle(start, end), law)
        assembly.join(pin)

    def _moved(self, record: Record) -> str:
        """The joint between the ends of a record, "" where there is none."""
        record.get("MarkerI"), record.get("MarkerJ")
        named, joints = record.get("MotionJoint").rpartition("/")[2], self.assembly.joints
        ends = {body for body, _ in self._ends(record)}
        between = (name for name, j in joints.items() if {j.first, j.second} == ends)
        return named if named in joints else next(between, "")

    def _limit(self, record: Record) -> None:
        name, sign = record.get("Name"), record.get("Type").strip()
        joint = self._moved(record)
        value = Formula(record.get("Limit"), f"{record.where}, {name}")()
        if not joint or sign not in ("=>", ">=", "=<", "<="):
            self.assembly.drawing.note(f"limit {name} of {record.get('MotionJoint')}: left out")
            return
        low, high = self.assembly.joints[joint].limits
        self.assembly.change(joint, limits=(value, high) if ">" in sign else (low, value))

    def _force(self, record: Record) -> None:
        """A force along the line of two markers that is a spring and damper."""
        name = record.get("Name") or record.first("ItemIJ").get("Name")
        if record.tag not in ("InLineForceTorque", "ForceTorqueInLine"):
            self.assembly.drawing.note(f"{record.tag} {name}: left out".replace("  ", " "))
            record.skip()
            return
        name = name or "spring"
        (first, pose), (second, second_pose) = self._ends(record)
        where = f"{record.where}, {name}"
        pull = Formula(record.get("tension"), where)
        start, k, c = (pull(time=0.0, rIJ=r, vrIJ=v) for r, v in ((0, 0), (1, 0), (0, 1)))
        k, c = k - start, c - start
        straight = abs(pull(time=1.0, rIJ=2.0, vrIJ=3.0) - start - 2 * k - 3 * c)
        if straight > 1e-9 * (abs(k) + abs(c) + abs(start)) or not k or -start / k < 0:
            self.assembly.drawing.note(
                f"{name}: {record.get('tension')[:60]} is no spring: left out"
            )
            return
        if Formula(record.get("twist", "0"), where)(time=0.0, rIJ=1.0, vrIJ=1.0):
            self.assembly.drawing.note(f"{name}: its twist: left out")
        ends = (self.assembly.flat(pose.origin), self.assembly.flat(second_pose.origin))
        self.assembly.drawing.springs.append(Spring(name, (first, second), ends, k, -start / k, c))


def _angle(first: Pose, second: Pose) -> float:
    """How far [rad] the second is turned about the z axis of the first."""
    rotation = first.axes.T @ second.axes
    return math.atan2(rotation[1, 0], rotation[0, 0])


def _recognises(text: str) -> bool:
    head = text[:500]
    return bool(re.search(r"^Assembly\s*$", head, re.MULTILINE)) or head.startswith("OndselSolver")


READER = Reader("FreeCAD, Ondsel: a planar assembly", (".asmt",), _recognises, read)
