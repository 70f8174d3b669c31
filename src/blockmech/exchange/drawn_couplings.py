"""Couplings of a drawing as a document has them: gears, belts, racks, cams and ratios.

Each is between two joints, the first and second of the drawing; ``leading`` is the number of the
one that is driven, and ``scale`` the drawing's unit [m].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import TypeAlias

from blockmech.exchange.drawing import Cam, Ratio, Wheels, scaled
from blockmech.ground.tolerances import ROUNDING
from blockmech.typing import Data

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
