"""An independent judge: planar multibody mechanics in absolute coordinates.

Knows links, joints and one big system of equations, and nothing of Assur groups: no closed
form, no order of formation, no code shared with the package. The model is the joint-based
document written as dataclasses; field names are the document's keys. Unknowns are the poses
[x, y, angle] of all links, in the order of `System.links`; "frame" is the fixed link.

Every scalar that mechanics needs here (a closure condition, a driven coordinate, the length of
a spring) is a `Row`: its value, its gradient in the 3n coordinates and its bias. The same
gradient gives rates, accelerations and, transposed, the generalised force that works on it:

    joints close, drivers hold     G q' = s'       G q'' = s'' - bias
    motion of all links            M q'' + h = Q + G^T x + H^T t

x holds what the joints and drivers exert, t the friction of each pair along its own coordinate.

Signs: forces are those of the joint's first link on its second, in ground axes; couples are
counter-clockwise; a driver's effort acts on the second link along its growing coordinate. A P
joint carries N along n (guide of the first link turned +90 degrees) through the slider's point
S, a couple C about S and friction T along the guide. SI units and radians throughout.

Precision follows the poses: float64 in, float64 out; poses of `assemble(..., refine=True)` are
np.longdouble, and whatever is computed from them is extended too. Linear systems are solved in
double and refined with extended residuals. Shapes: n links, d drivers, 3n = 2 joints + d.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.integrate import DOP853

Array = np.ndarray
Pair = tuple[float, float]
Names = tuple[str, str]
Places = tuple[Pair, Pair]

REFINEMENTS = 4  # of a linear solution; each gains 16 digits less the digits of the condition
REST_TOLERANCE = 1e-12  # [-] of the largest speed: slower pairs count as at rest
FRICTION_STEP = 0.125  # [-] largest step of the friction scale
FRICTION_ITERATIONS = 7  # of Newton, from a guess good to a tenth: quadratic to the last digit
LONGEST_STEP = 0.25  # [-] longest step of any pose in Newton and `follow`: system sizes, rad


class NoSolution(RuntimeError):
    """The links cannot be assembled, or Newton lost its way."""


# ---- The model ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Link:
    """A rigid link: mass [kg], inertia about the centre of mass [kg m2], places in its frame."""

    mass: float = 0.0
    inertia: float = 0.0
    cm: Pair = (0.0, 0.0)
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)  # approximate: fixes the assembly mode


@dataclass(frozen=True)
class Friction:
    """Coulomb friction: on the pin's radius [m] (R), or in a guide of given length [m] (P)."""

    coefficient: float
    radius: float = 0.0
    guide_length: float | None = None


@dataclass(frozen=True)
class Joint:
    """R: two points coincide. P: two directed lines coincide (`at` and `angle` on each link)."""

    type: Literal["R", "P"]
    links: Names
    at: Places
    angle: Pair = (0.0, 0.0)
    slider: int = 1  # which of the two links owns the slider's point S
    friction: Friction | None = None


@dataclass(frozen=True)
class Driver:
    """Drives the coordinate of a joint, or else the distance between two points.

    Coordinate of R: angle of the second link minus angle of the first. Of P: from the first
    link's point to the second's, along the guide of the first.
    """

    joint: str | None = None
    links: Names | None = None
    at: Places | None = None


@dataclass(frozen=True)
class Force:
    """A force [N] at a point of a link, given in ground axes or in the link's own."""

    link: str
    at: Pair
    force: Pair
    axes: Literal["ground", "link"] = "ground"


@dataclass(frozen=True)
class Couple:
    """A couple [N m] on a link."""

    link: str
    moment: float


@dataclass(frozen=True)
class Spring:
    """A spring [N/m] with damper [N s/m] between two points."""

    links: Names
    at: Places
    stiffness: float
    free_length: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True)
class TorsionSpring:
    """A spring and damper on the relative angle of two links, or on a joint's coordinate."""

    stiffness: float
    rest_angle: float = 0.0
    damping: float = 0.0
    links: Names | None = None
    joint: str | None = None


Load = Force | Couple | Spring | TorsionSpring
KINDS = {"force": Force, "couple": Couple, "spring": Spring, "torsion_spring": TorsionSpring}


@dataclass(frozen=True)
class System:
    """Links, joints, drivers and loads by name; their order is the order of all arrays here."""

    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    drivers: Mapping[str, Driver] = field(default_factory=dict)
    loads: Mapping[str, Load] = field(default_factory=dict)
    gravity: Pair = (0.0, 0.0)

    def __post_init__(self) -> None:
        unknowns, conditions = 3 * len(self.links), 2 * len(self.joints) + len(self.drivers)
        if unknowns != conditions:
            raise ValueError(f"{unknowns} coordinates, {conditions} conditions by joints, drivers")

    @property
    def home(self) -> Array:
        """The links' approximate poses, (n, 3)."""
        return np.array([link.pose for link in self.links.values()], float)


def read(document: Mapping[str, Any]) -> System:
    """The system of a joint-based document (`blockmech/joints`), without laws and markers."""

    def plain(value: Any) -> Any:
        if isinstance(value, Mapping) and "polar" in value:
            radius, angle = value["polar"]
            return (radius * np.cos(angle), radius * np.sin(angle))
        return tuple(map(plain, value)) if isinstance(value, list | tuple) else value

    def made(kind: Any, spec: Mapping[str, Any], *ignored: str) -> Any:
        return kind(**{key: plain(value) for key, value in spec.items() if key not in ignored})

    def joint(spec: Mapping[str, Any]) -> Joint:
        friction = spec.get("friction")
        return made(Joint, {**spec, "friction": friction and made(Friction, friction, "law")})

    def driver(spec: Mapping[str, Any]) -> Driver:
        return made(Driver, {key: spec[key] for key in ("joint", "links", "at") if key in spec})

    def load(spec: Mapping[str, Any]) -> Load:
        return made(KINDS[spec["type"]], spec, "type", "useful")

    def section(key: str) -> Mapping[str, Any]:
        return document.get(key, {})

    return System(
        links={name: made(Link, spec, "markers") for name, spec in section("links").items()},
        joints={name: joint(spec) for name, spec in section("joints").items()},
        drivers={name: driver(spec) for name, spec in section("drivers").items()},
        loads={name: load(spec) for name, spec in section("loads").items()},
        gravity=plain(document.get("gravity", (0.0, 0.0))),
    )


# ---- Points, rows, constraints ------------------------------------------------------------------


class Point(NamedTuple):
    """A point of a link: place (2,) [m], gradient (2, 3n), bias (2,) [m/s2]."""

    place: Array
    gradient: Array
    bias: Array


class Row(NamedTuple):
    """A scalar s of the coordinates: s' = gradient @ q', s'' = gradient @ q'' + bias."""

    value: Any
    gradient: Array
    bias: Any


class Instant:
    """A system at given poses (n, 3) and rates (n, 3): makes its points and rows."""

    def __init__(self, system: System, poses: Array, rates: Array | None = None) -> None:
        self.system = system
        self.poses = np.asarray(poses, np.result_type(poses, float))
        self.dtype = self.poses.dtype
        self.rates = np.zeros_like(self.poses) if rates is None else np.asarray(rates, self.dtype)
        self.q_dot = self.rates.ravel()
        self.index = {name: i for i, name in enumerate(system.links)}

    def point(self, link: str, at: Pair) -> Point:
        """A point of a link from its place `at` in the link's frame."""
        gradient = np.zeros((2, self.poses.size), self.dtype)
        if link == "frame":
            return Point(np.array(at, self.dtype), gradient, np.zeros(2, self.dtype))
        i = self.index[link]
        arm = self.direction(link) @ np.array([at, (-at[1], at[0])], self.dtype)
        gradient[0, 3 * i] = gradient[1, 3 * i + 1] = 1
        gradient[:, 3 * i + 2] = turned(arm)
        return Point(self.poses[i, :2] + arm, gradient, -(self.rates[i, 2] ** 2) * arm)

    def angle(self, link: str) -> Row:
        """The angle of a link."""
        gradient = np.zeros(self.poses.size, self.dtype)
        zero = self.dtype.type(0)
        if link == "frame":
            return Row(zero, gradient, zero)
        gradient[3 * self.index[link] + 2] = 1
        return Row(self.poses[self.index[link], 2], gradient, zero)

    def direction(self, link: str, angle: float = 0.0) -> Array:
        """The unit vector (2,) at an angle in the link's frame."""
        total = self.angle(link).value + self.dtype.type(angle)
        return np.array([np.cos(total), np.sin(total)])

    def separation(self, links: Names, at: Places) -> Point:
        """Second point minus first, as if it were a point."""
        first, second = self.point(links[0], at[0]), self.point(links[1], at[1])
        return Point(*(b - a for a, b in zip(first, second, strict=True)))

    def turn(self, links: Names) -> Row:
        """Angle of the second link minus angle of the first."""
        first, second = self.angle(links[0]), self.angle(links[1])
        return Row(*(b - a for a, b in zip(first, second, strict=True)))

    def distance(self, links: Names, at: Places) -> Row:
        """Distance between two points."""
        d = self.separation(links, at)
        length = np.hypot(*d.place)
        e = d.place / length
        across = turned(e) @ d.gradient @ self.q_dot
        return Row(length, e @ d.gradient, e @ d.bias + across**2 / length)

    def along(self, joint: Joint, quarter: bool) -> Row:
        """Separation of a P joint's points along its guide, or along n (`quarter`)."""
        d = self.separation(joint.links, joint.at)
        guide, turning = self.direction(joint.links[0], joint.angle[0]), self.angle(joint.links[0])
        e = turned(guide) if quarter else guide
        omega, e_1 = turning.gradient @ self.q_dot, turned(e)
        gradient = e @ d.gradient + (e_1 @ d.place) * turning.gradient
        bias = e @ d.bias + 2 * omega * (e_1 @ d.gradient @ self.q_dot)
        return Row(e @ d.place, gradient, bias - omega**2 * (e @ d.place))

    def closure(self, joint: Joint) -> list[Row]:
        """The two conditions of a joint, in the order of its reaction: Fx, Fy or N, C."""
        if joint.type == "R":
            return [Row(*row) for row in zip(*self.separation(joint.links, joint.at), strict=True)]
        first, second = (self.direction(*end) for end in zip(joint.links, joint.angle, strict=True))
        mismatch = np.arctan2(turned(first) @ second, first @ second)
        return [self.along(joint, quarter=True), self.turn(joint.links)._replace(value=mismatch)]

    def coordinate(self, of: Joint | Driver | TorsionSpring) -> Row:
        """The coordinate along which a pair slips, a driver drives, a torsion spring acts."""
        if isinstance(of, Driver) and of.joint is None:
            return self.distance(of.links, of.at)
        if isinstance(of, TorsionSpring) and of.joint is None:
            return self.turn(of.links)
        joint = of if isinstance(of, Joint) else self.system.joints[of.joint]
        return self.turn(joint.links) if joint.type == "R" else self.along(joint, quarter=False)

    def rows(self) -> tuple[Array, Array, Array]:
        """Values (3n,), gradients (3n, 3n), biases (3n,): two rows a joint, one a driver."""
        rows = [row for joint in self.system.joints.values() for row in self.closure(joint)]
        rows += [self.coordinate(driver) for driver in self.system.drivers.values()]
        values, gradients, biases = zip(*rows, strict=True)
        return np.array(values), np.array(gradients), np.array(biases)

    @property
    def size(self) -> Any:
        """Diagonal of the box around all joints [m]; 1 if they are in one point."""
        ends = [end for j in self.system.joints.values() for end in zip(j.links, j.at, strict=True)]
        places = np.array([self.point(*end).place for end in ends])
        return np.hypot(*(places.max(axis=0) - places.min(axis=0))) or self.dtype.type(1)

    @property
    def units(self) -> Array:
        """What the poses (n, 3) are measured by: the size, and 1 rad or the angle itself."""
        length = np.full((len(self.poses), 2), self.size)
        return np.column_stack([length, np.maximum(1, np.abs(self.poses[:, 2]))])

    def inertia(self) -> tuple[Array, Array]:
        """Mass matrix (3n, 3n) and the inertia forces (3n,) of zero accelerations."""
        mass = np.zeros((self.poses.size, self.poses.size), self.dtype)
        remaining = np.zeros(self.poses.size, self.dtype)
        for name, link in self.system.links.items():
            cm, turn = self.point(name, link.cm), self.angle(name).gradient
            mass += link.mass * cm.gradient.T @ cm.gradient + link.inertia * np.outer(turn, turn)
            remaining += link.mass * cm.bias @ cm.gradient
        return mass, remaining

    def applied(self) -> Array:
        """Generalised forces (3n,) of weight and loads."""
        total = np.zeros(self.poses.size, self.dtype)
        gravity = np.array(self.system.gravity, self.dtype)
        for name, link in self.system.links.items():
            total += link.mass * gravity @ self.point(name, link.cm).gradient
        for load in self.system.loads.values():
            if isinstance(load, Force):
                force = np.array(load.force, self.dtype)
                if load.axes == "link":
                    force = self.direction(load.link) @ np.array([force, turned(force)])
                total += force @ self.point(load.link, load.at).gradient
            elif isinstance(load, Couple):
                total += load.moment * self.angle(load.link).gradient
            else:
                row, rest = self.stretch(load)
                pull = load.stiffness * (row.value - rest)
                total -= (pull + load.damping * (row.gradient @ self.q_dot)) * row.gradient
        return total

    def stretch(self, load: Spring | TorsionSpring) -> tuple[Row, float]:
        """The coordinate of a spring and its value without tension."""
        if isinstance(load, Spring):
            return self.distance(load.links, load.at), load.free_length
        return self.coordinate(load), load.rest_angle


def turned(v: Array) -> Array:
    """The vector (2,) turned by +90 degrees."""
    return np.array([-v[1], v[0]])


def solve(matrix: Array, rhs: Array) -> Array:
    """Solve a square system, right side (m,) or (m, k), in double; refine it in extended."""
    scale = np.abs(matrix).max(axis=1, keepdims=True)
    scale[scale == 0] = 1
    wide = matrix.astype(np.longdouble) / scale
    target = rhs.astype(np.longdouble) / (scale if rhs.ndim == 2 else scale[:, 0])
    inverse = np.linalg.inv(wide.astype(float))
    x = np.zeros_like(target)
    for _ in range(REFINEMENTS + 1):
        x += inverse @ (target - wide @ x).astype(float)
    return x.astype(matrix.dtype)


# ---- Motion -------------------------------------------------------------------------------------


def assemble(
    system: System,
    q0: Array,
    driver_values: Sequence[float],
    *,
    follow: bool = False,
    refine: bool = False,
) -> Array:
    """Poses (n, 3) that close all joints at the given driver coordinates (d,), by Newton.

    `q0` (n, 3) is a guess. With `follow` it is first assembled at its own driver coordinates,
    then led to the wanted ones along the straight line in small steps, so that it stays in its
    assembly mode over any number of turns. `refine` finishes in extended precision and returns
    np.longdouble: rounded to double the poses are right to an ulp where conditioning allows.
    """
    poses, target = np.array(q0, float), np.array(driver_values)
    if follow:
        poses = _follow(system, poses, target.astype(float))
    poses = _close(system, poses, target.astype(float))
    return _close(system, poses.astype(np.longdouble), target) if refine else poses


def _close(system: System, poses: Array, driver_values: Array, iterations: int = 60) -> Array:
    """Newton with limited steps; stops where rounding stops it."""
    last = np.inf
    for _ in range(iterations):
        instant = Instant(system, poses)
        values, gradients, _ = instant.rows()
        values[2 * len(system.joints) :] -= driver_values
        try:
            step = solve(gradients, -values).reshape(-1, 3)
        except np.linalg.LinAlgError:
            break
        change = np.abs(step / instant.units).max()
        poses = poses + step / max(1, change / LONGEST_STEP)
        if change < 1e-8 and (change > last / 4 or change < np.finfo(poses.dtype).eps):
            return poses
        last = change
    raise NoSolution(f"Newton does not close the joints; its last step was {float(last):.3g}")


def _follow(system: System, guess: Array, target: Array) -> Array:
    """Close a guess at its own driver values, then lead it to the target along a straight line."""
    start = Instant(system, guess).rows()[0][2 * len(system.joints) :]
    poses, done, step = _close(system, guess, start), 0.0, 1.0
    while done < 1:
        units = Instant(system, poses).units
        tangent = rates(system, poses, target - start)
        step = min(step, 1 - done, LONGEST_STEP / max(np.abs(tangent / units).max(), LONGEST_STEP))
        ahead = poses + step * tangent
        try:
            result = _close(system, ahead, start + (done + step) * (target - start), iterations=10)
            moved, corrected = (np.abs((result - old) / units).max() for old in (poses, ahead))
        except NoSolution:
            moved, corrected = 0.0, np.inf
        if corrected <= moved / 4 + 1e-10:  # the second part is rounding's
            poses, done, step = result, done + step, 2 * step
        elif step > 1e-12:
            step /= 2
        else:
            raise NoSolution(f"the way to the driver values ends after {done:.9f} of it")
    return poses


def rates(system: System, poses: Array, driver_rates: Sequence[float]) -> Array:
    """Rates (n, 3) of all poses [m/s, m/s, rad/s] at given driver rates (d,)."""
    _, gradients, biases = Instant(system, poses).rows()
    return solve(gradients, _on_drivers(biases, driver_rates)).reshape(-1, 3)


def accelerations(
    system: System, poses: Array, rates: Array, driver_accelerations: Sequence[float]
) -> Array:
    """Second derivatives (n, 3) of all poses at given driver accelerations (d,)."""
    _, gradients, biases = Instant(system, poses, rates).rows()
    return solve(gradients, _on_drivers(biases, driver_accelerations) - biases).reshape(-1, 3)


def _on_drivers(like: Array, values: Sequence[float]) -> Array:
    """A right side (3n,): zero for the joints, `values` for the drivers."""
    right = np.zeros_like(like)
    right[len(like) - len(values) :] = values
    return right


def conditioning(system: System, poses: Array) -> float:
    """2-norm condition of the Jacobian: lengths over the system's size, rows of unit length."""
    instant = Instant(system, poses)
    gradients = instant.rows()[1].reshape(poses.size, -1, 3) * np.array([instant.size] * 2 + [1])
    gradients = gradients.reshape(poses.size, -1).astype(float)
    return float(np.linalg.cond(gradients / np.linalg.norm(gradients, axis=1, keepdims=True)))


# ---- Forces -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class JointReaction:
    """What the joint's first link exerts on its second.

    force (2,) [N] in ground axes: all of R, N n of P; N [N] and C [N m] about S (P only);
    friction couple [N m] or force [N]; slip, the coordinate's rate [rad/s] or [m/s]; limit, the
    largest friction the pair can have under this reaction (0 without friction). A pair at rest
    has friction 0 here and really anything from -limit to limit.
    """

    force: Array
    N: Any
    C: Any
    friction: Any
    slip: Any
    limit: Any


@dataclass(frozen=True)
class Reactions:
    """Reactions by joint, efforts by driver [N m] or [N], and how the friction was found.

    Where `converged` is false, Coulomb's equations were followed from zero friction up to
    `scale` times the given coefficients; the numbers belong to that scale.
    """

    joints: dict[str, JointReaction]
    drivers: dict[str, Any]
    converged: bool = True
    scale: float = 1.0
    at_rest: tuple[str, ...] = ()

    @property
    def friction_power(self) -> Any:
        """Power lost in all joints [W]."""
        return -sum(joint.friction * joint.slip for joint in self.joints.values())


def reactions(
    system: System,
    poses: Array,
    rates: Array,
    accelerations: Array,
    friction: bool = True,
    *,
    rest_tolerance: float = REST_TOLERANCE,
    sense: Mapping[str, float] | None = None,
) -> Reactions:
    """Reactions and driving efforts of a given motion, all arrays (n, 3).

    Friction opposes the slip of each pair. Pairs slower than `rest_tolerance` times the fastest
    speed count as at rest and get none, unless `sense` gives them a sense of slip, +1 or -1.
    """
    instant = Instant(system, poses, rates)
    mass, remaining = instant.inertia()
    gradients = instant.rows()[1]
    free = mass @ np.asarray(accelerations, instant.dtype).ravel() + remaining - instant.applied()
    rough = [name for name, joint in system.joints.items() if friction and joint.friction]
    resting = _resting(instant, rough, rest_tolerance)
    signs = {name: np.sign(_slip(instant, system.joints[name])) for name in rough}
    signs |= {name: (sense or {}).get(name, 0.0) for name in resting}
    rubbing = [name for name in rough if signs[name]]
    slips = [instant.coordinate(system.joints[name]).gradient for name in rubbing]
    # What joints and drivers exert is affine in the frictions t: exerted = x[:, 0] + x[:, 1:] t
    x = solve(gradients.T, np.column_stack([free, *(-slip for slip in slips)]))
    t, converged, scale = _rub(instant, rubbing, x, signs)
    exerted = x[:, 0] + x[:, 1:] @ t
    efforts = exerted[2 * len(system.joints) :]
    still = tuple(name for name in resting if not signs[name])
    report = _report(instant, exerted, dict(zip(rubbing, t, strict=True)), efforts)
    return Reactions(*report, converged, scale, still)


def _slip(instant: Instant, joint: Joint) -> Any:
    return instant.coordinate(joint).gradient @ instant.q_dot


def _resting(instant: Instant, names: Sequence[str], tolerance: float) -> list[str]:
    """Joints whose relative speed is zero to rounding, measured by the fastest speed there is."""
    size, joints = instant.size, instant.system.joints
    ends = [end for joint in joints.values() for end in zip(joint.links, joint.at, strict=True)]
    speeds = [np.hypot(*(instant.point(*end).gradient @ instant.q_dot)) for end in ends]
    fastest = max(max(speeds), size * np.abs(instant.rates[:, 2]).max())
    arm = {name: size if joints[name].type == "R" else 1 for name in names}
    slow = tolerance * fastest
    return [name for name in names if abs(_slip(instant, joints[name])) * arm[name] <= slow]


def _carried(instant: Instant, name: str, exerted: Array) -> Array:
    """[Fx, Fy] of an R joint, [N, C about S] of a P joint: rows of `exerted`, (2,) or (2, k)."""
    joint = instant.system.joints[name]
    k = 2 * list(instant.system.joints).index(name)
    first, second = exerted[k], exerted[k + 1]
    if joint.type == "P" and joint.slider == 0:  # from the second link's point to the first's
        second = second + instant.coordinate(joint).value * first
    return np.array([first, second])


def _pressure(joint: Joint, carried: Array) -> tuple[Any, Array]:
    """What presses the pair together [N], and its gradient (2,) in the two carried parts."""
    if joint.type == "R":
        size = np.hypot(*carried)
        return size, carried / size if size else np.zeros_like(carried)
    normal, couple = carried
    length = joint.friction.guide_length if joint.friction else None
    if length and 2 * abs(couple) / length > abs(normal):
        return 2 * abs(couple) / length, np.array([0 * normal, 2 * np.sign(couple) / length])
    return abs(normal), np.array([np.sign(normal), 0 * normal])


def _arm(joint: Joint) -> float:
    """Friction over pressure: a length [m] for R, a number [-] for P."""
    if joint.friction is None:
        return 0.0
    return joint.friction.coefficient * (joint.friction.radius if joint.type == "R" else 1.0)


def _rub(
    instant: Instant, names: Sequence[str], x: Array, signs: Mapping[str, float]
) -> tuple[Array, bool, float]:
    """Solve t = strength * pressure(t) on the branch that starts at zero friction.

    Continuation in a common scale of all coefficients: tangent predictor, Newton corrector.
    The determinant is 1 at zero friction and must stay positive; it vanishes at a fold and at
    an asymptote, beyond which this branch has no solution. Returns t (m,), success and scale.
    """
    joints = [instant.system.joints[name] for name in names]
    strength = np.array([-signs[n] * _arm(j) for n, j in zip(names, joints, strict=True)], x.dtype)
    carried = [_carried(instant, name, x) for name in names]
    identity = np.eye(len(names), dtype=x.dtype)

    def law(t: Array, scale: float) -> tuple[Array, Array]:
        """Friction (m,) by Coulomb's law under t, and the Newton matrix (m, m)."""
        parts = [_pressure(j, c[:, 0] + c[:, 1:] @ t) for j, c in zip(joints, carried, strict=True)]
        values = np.array([value for value, _ in parts], x.dtype)
        slopes = np.array([g @ c[:, 1:] for (_, g), c in zip(parts, carried, strict=True)], x.dtype)
        return scale * strength * values, identity - scale * strength[:, None] * slopes

    def ahead(t: Array, scale: float, share: float) -> Array | None:
        """The friction at scale + share; None if Newton fails, jumps or has passed a fold."""
        try:
            guess = found = t + share * solve(law(t, scale)[1], law(t, 1.0)[0])
            for _ in range(FRICTION_ITERATIONS):
                friction, matrix = law(found, scale + share)
                last, found = found, found + solve(matrix, friction - found)
        except np.linalg.LinAlgError:
            return None
        largest, matrix = np.abs(found).max(), law(found, scale + share)[1]
        settled = np.abs(found - last).max() <= 1e-10 * largest
        near = np.abs(found - guess).max() <= 0.1 * largest
        return found if settled and near and np.linalg.det(matrix.astype(float)) > 0 else None

    t, scale, step = np.zeros(len(names), x.dtype), 0.0, FRICTION_STEP
    while names and scale < 1 and step > 1e-12:
        step = min(step, 1 - scale, FRICTION_STEP)
        found = ahead(t, scale, step)
        if found is None:
            step /= 2
        else:
            t, scale, step = found, scale + step, 2 * step
    return t, scale >= 1 or not names, scale if names else 1.0


def _report(
    instant: Instant, exerted: Array, friction: Mapping[str, Any], efforts: Sequence[float]
) -> tuple[dict[str, JointReaction], dict[str, Any]]:
    """Name what joints and drivers exert."""
    joints = {}
    for name, joint in instant.system.joints.items():
        carried = _carried(instant, name, exerted)
        force, N, C = carried, None, None
        if joint.type == "P":
            N, C = carried
            force = N * turned(instant.direction(joint.links[0], joint.angle[0]))
        limit = _arm(joint) * _pressure(joint, carried)[0]
        t = friction.get(name, instant.dtype.type(0))
        joints[name] = JointReaction(force, N, C, t, _slip(instant, joint), limit)
    return joints, dict(zip(instant.system.drivers, efforts, strict=True))


# ---- Forward dynamics ---------------------------------------------------------------------------


def forward_acceleration(
    system: System, poses: Array, rates: Array, driver_efforts: Sequence[float]
) -> tuple[Array, Reactions]:
    """Second derivatives (n, 3) and reactions under given driver efforts (d,), without friction."""
    instant = Instant(system, poses, rates)
    held = 2 * len(system.joints)
    _, gradients, biases = instant.rows()
    mass, remaining = instant.inertia()
    efforts = np.array(driver_efforts, instant.dtype)
    free = instant.applied() - remaining + efforts @ gradients[held:]
    matrix = np.zeros((poses.size + held,) * 2, instant.dtype)
    matrix[: poses.size, : poses.size] = mass
    matrix[: poses.size, poses.size :] = -gradients[:held].T
    matrix[poses.size :, : poses.size] = gradients[:held]
    solution = solve(matrix, np.concatenate([free, -biases[:held]]))
    report = _report(instant, solution[poses.size :], {}, efforts)
    return solution[: poses.size].reshape(-1, 3), Reactions(*report)


def integrate(
    system: System,
    poses: Array,
    rates: Array,
    t_eval: Sequence[float],
    efforts: Sequence[float] | Callable[[float, Array, Array], Sequence[float]],
    *,
    tolerance: float = 1e-13,
) -> tuple[Array, Array]:
    """Poses and rates (k, n, 3) at the times `t_eval` (k,) [s]; the first is the start.

    DOP853 in all coordinates, projected onto the joints after every step; no friction.
    `efforts` of the drivers (d,), constant or a function of time, poses and rates.
    """
    shape = poses.shape

    def slope(t: float, y: Array) -> Array:
        q, q_dot = (part.reshape(shape) for part in np.split(y, 2))
        given = efforts(t, q, q_dot) if callable(efforts) else efforts
        return np.concatenate(
            [q_dot.ravel(), forward_acceleration(system, q, q_dot, given)[0].ravel()]
        )

    times = np.asarray(t_eval, float)
    size = float(Instant(system, poses).size)
    scale = np.tile([size, size, 1.0], len(poses))
    atol = tolerance * np.concatenate([scale, scale / max(np.ptp(times), np.finfo(float).tiny)])
    y, step = _project(system, np.concatenate([poses.ravel(), rates.ravel()]).astype(float)), None
    out = [y]
    for start, end in pairwise(times):
        first = min(step, end - start) if step else None
        solver = DOP853(slope, start, y, end, rtol=tolerance, atol=atol, first_step=first)
        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                raise NoSolution(f"integration stops at {solver.t:.9g} s: {message}")
            step = max(step or 0, solver.step_size) if solver.status == "finished" else solver.h_abs
            solver.y = _project(system, solver.y)
            solver.f = slope(solver.t, solver.y)
        y = solver.y
        out.append(y)
    result = np.array(out).reshape(len(out), 2, *shape)
    return result[:, 0], result[:, 1]


def _project(system: System, y: Array) -> Array:
    """The nearest state that closes the joints, and whose rates keep them closed."""
    q, q_dot = np.split(y, 2)
    held = 2 * len(system.joints)
    for _ in range(2):
        values, gradients, _ = Instant(system, q.reshape(-1, 3)).rows()
        q = q - np.linalg.lstsq(gradients[:held], values[:held], rcond=None)[0]
    gradients = Instant(system, q.reshape(-1, 3)).rows()[1][:held]
    return np.concatenate([q, q_dot - np.linalg.lstsq(gradients, gradients @ q_dot, rcond=None)[0]])
