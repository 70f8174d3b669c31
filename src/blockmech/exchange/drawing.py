"""A drawing of a linkage: what the files of other tools have in common.

Tools that draw say: points with places, links as lists of points, points that are fixed, points
that slide on a line, points that are driven. Tools that assemble say: pairs of two links, each
with its place and axis. A drawing has both, and what else they know: welds, gears, racks, belts,
ratios, laws of motion, limits, springs, masses, forces.

A coupling of a drawing is between two joints, the first and second of the drawing; ``leading`` is
the number of the one that is driven, and ``scale`` the drawing's unit [m].
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple, TypeAlias

from blockmech.ground.errors import FormatError, Problem
from blockmech.ground.tolerances import ROUNDING
from blockmech.typing import Data, Record

FRAME = "frame"
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
TURN = (0.0, math.tau)
STEP = 0.05  # [rad], and of the size of a drawing: of a joint that is tried, beside a copy
FREE = (-math.inf, math.inf)
COORDINATES = ("rate", "acceleration", "from", "to", "mean", "amplitude", "values", "rise")
"""Numbers of a law of motion that are coordinates, or their rates."""


class Slot(NamedTuple):
    """A line [rad] of the drawing on which a point slides.

    on : the link that has it
    rider : the link that slides itself; without one a slider without mass does
    through : a point of the line, where the drawn one may be beside it
    """

    angle: float
    on: str = FRAME
    rider: str = ""
    through: complex | None = None


class Drive(NamedTuple):
    """What drives a point or a pair, which counts from the drawn pose.

    rate, start, stop : [rad/s or length/s], and the interval that is gone through
    link : the one that a driven point turns
    law : a law of motion of a document in place of these, lengths in the drawing's unit
    """

    rate: float = 1.0
    start: float = TURN[0]
    stop: float | None = TURN[1]
    link: str = ""
    law: Record | None = None


class Inertia(NamedTuple):
    """Mass [kg], inertia [kg m2] about the centre of mass, and where that is drawn."""

    mass: float
    inertia: float
    cm: complex


class Pair(NamedTuple):
    """A pin of two links, or with an angle [rad] a guide; its coordinate counts from the first.

    at, second_at : its place on the first link and, where it differs, on the second
    limits : least and largest coordinate
    stiffness, rest, damping : of a spring along the coordinate
    """

    first: str
    second: str
    at: complex
    angle: float | None = None
    drive: Drive | None = None
    second_at: complex | None = None
    name: str = ""  # of its joint, by default both links
    limits: tuple[float, float] = FREE
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0


class Weld(NamedTuple):
    """Two links that are one rigid link, under names of their own.

    at, second_at : a place on the first link and, where it differs, on the second
    turn : angle [rad] by which the second is drawn ahead of where it is welded
    """

    name: str
    first: str
    second: str
    at: complex = 0j
    second_at: complex | None = None
    turn: float = 0.0


class Wheels(NamedTuple):
    """Two links that turn as gear wheels or by a chain, with their sizes: teeth or radii.

    Of gears that are drawn by their pitch point alone, sizes follow from the centres; sizes of
    unlike signs are a wheel in a ring. With a ``rack`` the second slides as the first turns
    counter-clockwise, its size a radius, in this direction [rad].
    """

    name: str
    first: str
    second: str
    sizes: tuple[float, float] = (1.0, 1.0)
    chain: bool = False
    pitch: complex | None = None
    rack: float | None = None

    @property
    def slides(self) -> bool:
        """Whether the second is a rack."""
        return self.rack is not None


class Cam(NamedTuple):
    """A cam that turns on the frame and its follower, which slides or swings there.

    law : of the follower's coordinate over the cam's angle from the drawn pose, of a coupling
    tip, roller : where the follower touches with a roller of this radius; without one an edge
    """

    name: str
    first: str
    second: str
    law: Record
    tip: complex
    slides: bool
    roller: float = 0.0
    phase: float = 0.0


class Ratio(NamedTuple):
    """A pair whose coordinate is a polynomial of another one's, lowest power first."""

    name: str
    leading: str
    driven: str
    coefficients: tuple[float, ...]


class Load(NamedTuple):
    """A force [N] at a place of a link."""

    name: str
    link: str
    at: complex
    force: complex
    turns: bool  # with the link


class Spring(NamedTuple):
    """A spring [N/m] and damper [N s/m] between places of two links, its length free of force."""

    name: str
    links: tuple[str, str]
    at: tuple[complex, complex]
    stiffness: float
    free_length: float = 0.0
    damping: float = 0.0


@dataclass
class Drawing:
    """A linkage as it is drawn, lengths in ``unit``."""

    name: str = ""
    unit: str = ""
    source: str = ""
    points: dict[str, complex] = field(default_factory=dict)
    links: dict[str, list[str]] = field(default_factory=dict)
    fixed: set[str] = field(default_factory=set)
    slots: dict[str, list[Slot]] = field(default_factory=dict)
    pairs: list[Pair] = field(default_factory=list)
    welds: list[Weld] = field(default_factory=list)
    wheels: list[Wheels] = field(default_factory=list)
    cams: list[Cam] = field(default_factory=list)
    ratios: list[Ratio] = field(default_factory=list)
    drives: dict[str, Drive] = field(default_factory=dict)
    inertias: dict[str, Inertia] = field(default_factory=dict)
    loads: list[Load] = field(default_factory=list)
    springs: list[Spring] = field(default_factory=list)
    gravity: complex = 0j  # [m/s2]
    free: bool = False  # whether what nothing drives is meant to move freely
    notes: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Say what was not taken, or how something was read."""
        if text not in self.notes:
            self.notes.append(text)

    def is_fixed(self, point: str) -> bool:
        """Whether a point stands still: a fixed one that slides does so in a slot that moves."""
        return point in self.fixed and all(s.on != FRAME for s in self.slots.get(point, ()))

    def meeting(self) -> dict[str, list[str]]:
        """Point -> the links that meet there, the frame first."""
        ends = {point: [FRAME] if self.is_fixed(point) else [] for point in self.points}
        for name, points in self.links.items():
            for point in dict.fromkeys(points):
                ends[point].append(name)
        return ends

    def link_of(self, points: Iterable[str]) -> str | None:
        """The first link with all these points; the frame if all are fixed."""
        group = set(points)
        if group <= self.fixed:
            return FRAME
        return next((n for n, members in self.links.items() if group <= set(members)), None)


def together(bodies: Iterable[Inertia]) -> Inertia:
    """Mass and inertia of rigidly joined bodies, by the parallel-axis theorem."""
    parts = list(bodies)
    mass = sum(body.mass for body in parts)
    if not mass > 0:
        return Inertia(0.0, sum(body.inertia for body in parts), parts[0].cm)
    cm = sum(body.mass * body.cm for body in parts) / mass
    inertia = sum(body.inertia + body.mass * abs(body.cm - cm) ** 2 for body in parts)
    return Inertia(mass, inertia, cm)


def direction(a: complex, b: complex, where: str) -> float:
    """The angle [rad] of the line from a to b. Raises `FormatError` if they are at one place."""
    if a == b:
        message = "the two points of a line are at one place"
        raise FormatError(Problem("bad-drawing", where, message, "", "draw them apart"))
    return cmath.phase(b - a)


def scaled(law: Record, factor: float) -> Data:
    """A law of motion of a coordinate times a factor: in another unit, or counted the other way."""
    numbers = {key: law[key] for key in COORDINATES if key in law}
    times = {
        k: [factor * y for y in x] if isinstance(x, list) else factor * x
        for k, x in numbers.items()
    }
    return {**law, **times}


MOST_TEETH = 1000  # of a wheel whose size is a ratio
ON_LINE = 1e-3  # of the distance of two centres: how far from their line a pitch point is drawn
Note: TypeAlias = Callable[[str], None]


def wheels_that_mesh(
    pair: Wheels, scale: float, centres: Sequence[complex], leading: int, note: Note
) -> Data | None:
    """Gears, or a belt where teeth would not reach; a ratio that no teeth have is a law.

    centres : of both wheels [m]
    """
    a, b = centres
    first, second = pair.sizes
    if pair.pitch is not None:
        arms = [scale * pair.pitch - centre for centre in (a, b)]
        across = arms[0].conjugate() * arms[1]
        if not all(arms) or abs(across.imag) > ON_LINE * abs(a - b) ** 2:
            note(f"{pair.name} is not on the line of its wheels' centres: left out")
            return None
        first, second = abs(arms[0]), math.copysign(abs(arms[1]), -across.real)
    inside = first * second < 0
    sizes = [abs(first), abs(second)]
    apart = abs(abs(sizes[0] - sizes[1]) * scale - abs(a - b)) > ON_LINE * abs(a - b)
    if leading:
        sizes.reverse()
    if pair.chain or (inside and pair.pitch is None and apart):
        radii = [size * scale for size in sizes]
        if sum(radii) > abs(a - b):  # sizes that are teeth: the ratio is what counts
            radii = [size * abs(a - b) / (2 * sum(sizes)) for size in sizes]
            note(f"{pair.name}: radii from the ratio and the distance of the pins")
        return {"type": "belt", "radii": radii}
    exact = sizes[0] / sizes[1]
    teeth = Fraction(exact).limit_denominator(MOST_TEETH)
    if abs(float(teeth) / exact - 1) > ROUNDING:
        law = {"kind": "polynomial", "coefficients": [0.0, exact if inside else -exact]}
        return {"type": "ratio", "law": law}
    gear: Data = {"type": "gear", "teeth": [teeth.numerator, teeth.denominator]}
    return gear | ({"internal": True} if inside else {})


def rack_and_pinion(pair: Wheels, scale: float, direction: float) -> Data:
    """A rack on the side of its pinion that the drawing says.

    direction : [rad] in which the rack moves as its joint's coordinate grows
    """
    cosine = math.cos(direction - (pair.rack or 0.0))
    side = 1 if cosine * pair.sizes[0] > 0 else -1
    return {"type": "rack", "radius": abs(pair.sizes[0]) * scale, "side": side}


def cam_with_follower(cam: Cam, scale: float, leading: int, note: Note) -> Data | None:
    """A cam that leads its follower; the law of one that slides is in the drawing's unit."""
    if leading:
        note(f"{cam.name}: its follower is driven: left out")
        return None
    unit = scale if cam.slides else 1.0
    law = scaled(cam.law, unit)
    if "segments" in law:
        law["segments"] = [scaled(segment, unit) for segment in law["segments"]]
    tip = scale * cam.tip
    coupling = {"type": "cam", "law": law, "at": [tip.real, tip.imag], "phase": cam.phase * unit}
    roller = {"follower": "roller", "roller": cam.roller * scale} if cam.roller else {}
    return coupling | roller


def ratio_of_joints(pair: Ratio, units: Sequence[float], leading: int, note: Note) -> Data | None:
    """A polynomial of the leading joint's coordinate, whose inverse a straight line has.

    units : [rad or m] of both coordinates
    """
    c = [x * units[1] / units[0] ** k for k, x in enumerate(pair.coefficients)]
    while len(c) > 2 and not c[-1]:
        c.pop()
    if leading:
        if len(c) != 2 or not c[1]:
            note(f"{pair.name}: its driven side is driven, the law has no inverse")
            return None
        c = [-c[0] / c[1], 1 / c[1]]
    return {"type": "ratio", "law": {"kind": "polynomial", "coefficients": c}}
