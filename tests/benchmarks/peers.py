"""Forward dynamics by other packages, as a user of each would ask for it at its best.

All get the same machine: the file that `blockmech.write` makes for MuJoCo, whose tree of bodies
and closed loops are read here for Exudyn and by Pinocchio itself; the loads, which that file
leaves out, are added by each package's own means. A setting is a tolerance or a time step;
`curve` has the errors and times of some.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import blockmech as bm

Answer = Callable[[float], tuple[float, float]]  # setting -> processor time [s], last angle [rad]
TIMES = 3  # that a setting is measured
LONG = 2.0  # [s] after which no finer setting is tried
FINEST = 2e-10  # [rad] an error that ends a curve


@dataclass(frozen=True)
class Spring:
    """A spring [N/m] from a point of the frame to a point of a body [m], in axes as written."""

    body: str
    at: tuple[float, float]
    frame: tuple[float, float]
    stiffness: float
    free_length: float


@dataclass(frozen=True)
class Machine:
    """A mechanism at its start at rest: its file, its loads, the end [s] and the angle there."""

    path: Path
    start: float
    end: float
    angle: float
    couple: float = 0.0
    spring: Spring | None = None


def machine(graph: Path, folder: Path, start: float, end: float, angle: float) -> Machine:
    """A graph with a crank, and perhaps a couple on it and a spring to the frame."""
    data = json.loads(graph.read_text("utf-8"))["blocks"]
    mech = bm.Graph.load(graph).compile()
    (path,) = bm.write(mech, folder / f"{graph.stem}.xml", at={"crank": [start]})
    if "spring" not in data:
        return Machine(path, start, end, angle)
    at = mech.run(at=[start], want=["first.E.p", "first.D.p"], static=True)
    x = complex(at["first.E.p"][0] - at["first.D.p"][0])
    k = data["frame"]["markers"]["K"]["at"]
    load = data["spring"]
    spring = Spring("first.j", (x.real, x.imag), k, load["stiffness"], load["free_length"])
    return Machine(path, start, end, angle, data["couple"]["moment"], spring)


def curve(answer: Answer, settings: Iterable[float], right: float) -> list[tuple[float, float]]:
    """Errors of settings, coarse to fine, and the least processor times [s] of each."""
    points = []
    for setting in settings:
        seconds, angle = answer(setting)
        if seconds < LONG:
            seconds = min([seconds, *(answer(setting)[0] for _ in range(TIMES - 1))])
        points.append((abs(angle - right), seconds))
        if points[-1][0] < FINEST or seconds > LONG:
            break
    return points


class Body(NamedTuple):
    """A body of the tree, hung by a pin at its origin: places [m] at the start, axes as written."""

    name: str
    parent: str
    origin: np.ndarray
    centre: np.ndarray
    mass: float
    inertia: float


def tree(path: Path) -> tuple[list[Body], list[tuple[str, str, np.ndarray]], np.ndarray]:
    """Bodies from the frame on, pins that close loops (two bodies, a place), gravity."""
    root = ElementTree.parse(path).getroot()
    bodies: dict[str, Body] = {}

    def hung(parent: Any, name: str, origin: np.ndarray) -> None:
        for element in parent.findall("body"):
            own, place, inertial = element.get("name"), numbers(element, "pos"), element[1]
            centre = origin + place + numbers(inertial, "pos")
            mass, inertia = float(inertial.get("mass")), numbers(inertial, "diaginertia")[2]
            bodies[own] = Body(own, name, origin + place, centre, mass, inertia)
            hung(element, own, origin + place)

    hung(root.find("worldbody"), "", np.zeros(3))
    loops = []
    for loop in root.iter("connect"):
        one, other = str(loop.get("body1")), str(loop.get("body2"))
        loops.append((one, other, bodies[one].origin + numbers(loop, "anchor")))
    return list(bodies.values()), loops, numbers(root.find("option"), "gravity")


def numbers(element: Any, key: str) -> np.ndarray:
    """The numbers of an attribute."""
    return np.array([float(x) for x in element.get(key).split()])


def pinocchio(case: Machine) -> Answer:
    """Constrained dynamics of the tree, integrated by SciPy's DOP853 to a tolerance."""
    pin = pytest.importorskip("pinocchio", reason="Pinocchio, a peer, is not installed: pin")
    bodies, loops, gravity = tree(case.path)
    model, joints, origins = pin.Model(), {"": 0}, {"": np.zeros(3)}
    model.gravity.linear = gravity
    for b in bodies:
        shift = pin.SE3(np.eye(3), b.origin - origins[b.parent])
        joints[b.name] = model.addJoint(joints[b.parent], pin.JointModelRZ(), shift, b.name)
        origins[b.name] = b.origin
        inertia = pin.Inertia(b.mass, b.centre - b.origin, b.inertia * np.eye(3))
        model.appendBodyToJoint(joints[b.name], inertia, pin.SE3.Identity())
    closing = pin.StdVec_RigidConstraintModel()
    for one, other, place in loops:
        ends = [x for b in (one, other)
                for x in (joints[b], pin.SE3(np.eye(3), place - origins[b]))]  # fmt: skip
        closing.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, *ends))
    data, n = model.createData(), model.nv
    pairs = pin.StdVec_RigidConstraintData()
    for constraint in closing:
        pairs.append(constraint.createData())
    pin.initConstraintDynamics(model, data, closing, pairs)
    exact = pin.ProximalSettings(1e-14, 1e-12, 20)
    effort, crank = np.zeros(n), joints["crank.crank"] - 1
    effort[crank] = case.couple
    if spring := case.spring:
        rocker = joints[spring.body] - 1
        x, y, _ = origins[spring.body]
        arm, to_frame = complex(*spring.at), complex(*spring.frame) - complex(x, y)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        q, v = y[:n], y[n:]
        if spring:
            lever = arm * complex(math.cos(q[rocker]), math.sin(q[rocker]))
            line = to_frame - lever
            force = spring.stiffness * (1.0 - spring.free_length / abs(line)) * line
            effort[rocker] = lever.real * force.imag - lever.imag * force.real
        a = pin.constraintDynamics(model, data, q, v, effort, closing, pairs, exact)
        return np.concatenate([v, a])

    def answer(tolerance: float) -> tuple[float, float]:
        begin = time.process_time()
        span, rest = (0.0, case.end), np.zeros(2 * n)
        end = solve_ivp(rates, span, rest, "DOP853", rtol=tolerance, atol=tolerance).y[:, -1]
        return time.process_time() - begin, case.start + end[crank]

    return answer


def mujoco(case: Machine) -> Answer:
    """Soft loops as stiff as MuJoCo has them, its Runge-Kutta method with a step [s]."""
    package = pytest.importorskip("mujoco", reason="MuJoCo, a peer, is not installed: mujoco")
    tree = ElementTree.parse(case.path)
    root = tree.getroot()
    if spring := case.spring:
        for body, name, at in (
            (root.find("worldbody"), "K", spring.frame),
            (root.find(f".//body[@name='{spring.body}']"), "E", spring.at),
        ):
            assert body is not None
            ElementTree.SubElement(body, "site", name=name, pos=f"{at[0]!r} {at[1]!r} 0")
        law = {"stiffness": repr(spring.stiffness), "springlength": repr(spring.free_length)}
        tendon = ElementTree.SubElement(ElementTree.SubElement(root, "tendon"), "spatial", law)
        for site in ("K", "E"):
            ElementTree.SubElement(tendon, "site", site=site)

    def answer(step: float) -> tuple[float, float]:
        for element, key, value in (
            ("option", "timestep", step),
            ("default/equality", "solref", f"{2 * step!r} 1"),
        ):
            result = root.find(element)
            assert result is not None
            result.set(key, str(value))
        model = package.MjModel.from_xml_string(ElementTree.tostring(root, "unicode"))
        data = package.MjData(model)
        crank = model.joint("crank.A").qposadr[0]
        data.ctrl[0] = case.couple
        begin = time.process_time()
        package.mj_step(model, data, nstep=round(case.end / step))
        return time.process_time() - begin, case.start + float(data.qpos[crank])

    return answer


def exudyn(case: Machine) -> Answer:
    """Planar bodies and pins in redundant coordinates, generalised alpha, index 2, a step [s]."""
    exu = pytest.importorskip("exudyn", reason="Exudyn, a peer, is not installed: exudyn")
    from exudyn import itemInterface as items

    bodies, loops, gravity = tree(case.path)

    def built(container: Any) -> tuple[Any, Any]:
        system = container.AddSystem()
        objects = {"": system.AddObject(items.ObjectGround())}
        centres, nodes = {"": np.zeros(3)}, {}

        def at(name: str, place: np.ndarray) -> Any:
            """A marker of a body at a place of the start."""
            local = list(place - centres[name])
            return system.AddMarker(
                items.MarkerBodyPosition(bodyNumber=objects[name], localPosition=local)
            )

        for b in bodies:
            x, y, _ = centres[b.name] = b.centre
            node = items.NodeRigidBody2D(referenceCoordinates=[x, y, 0.0])
            nodes[b.name] = system.AddNode(node)
            body = items.ObjectRigidBody2D(nodeNumber=nodes[b.name], mass=b.mass, inertia=b.inertia)
            objects[b.name] = system.AddObject(body)
            weight = system.AddMarker(items.MarkerBodyMass(bodyNumber=objects[b.name]))
            load = items.LoadMassProportional(markerNumber=weight, loadVector=list(gravity))
            system.AddLoad(load)
        for one, other, place in [*((b.parent, b.name, b.origin) for b in bodies), *loops]:
            ends = [at(one, place), at(other, place)]
            system.AddObject(items.ObjectJointRevolute2D(markerNumbers=ends))
        crank = nodes["crank.crank"]
        if case.couple:
            turned = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=crank, coordinate=2))
            system.AddLoad(items.LoadCoordinate(markerNumber=turned, load=case.couple))
        if spring := case.spring:
            ends = [at("", np.array([*spring.frame, 0.0]))]
            origin = next(b.origin for b in bodies if b.name == spring.body)
            ends.append(at(spring.body, origin + np.array([*spring.at, 0.0])))
            system.AddObject(
                items.ObjectConnectorSpringDamper(
                    markerNumbers=ends,
                    stiffness=spring.stiffness,
                    referenceLength=spring.free_length,
                )
            )
        system.Assemble()
        return system, crank

    def answer(step: float) -> tuple[float, float]:
        container = exu.SystemContainer()  # a system lives as long as its container
        system, crank = built(container)
        how = exu.SimulationSettings()
        how.timeIntegration.numberOfSteps = round(case.end / step)
        how.timeIntegration.endTime = case.end
        how.timeIntegration.generalizedAlpha.useIndex2Constraints = True
        how.timeIntegration.generalizedAlpha.useNewmark = True
        how.timeIntegration.newton.useModifiedNewton = True
        how.timeIntegration.newton.relativeTolerance = 1e-10
        how.timeIntegration.verboseMode = 0
        how.solution.file.write = False
        how.show.statistics = how.show.computationTime = False
        begin = time.process_time()
        system.SolveDynamic(how)
        seconds = time.process_time() - begin
        turned = system.GetNodeOutput(crank, exu.OutputVariableType.Coordinates)[2]
        return seconds, case.start + float(turned)

    return answer
