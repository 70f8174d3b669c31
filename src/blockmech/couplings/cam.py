"""Cam: a turning disc whose profile moves a follower, translating or swinging.

      u                           A    centre of the cam
      ^  C   roller, knife edge   C    the follower's tip: knife edge or centre of the roller
      | (o)                       C'   its velocity for one unit of the cam's rate
     -+--+-- n                    n    (C - A) + i C', normal of the pitch curve, outward
       A                          P    A - C'/i, where cam and follower have one velocity

Whatever follower, the push goes along n through C, a flat face's along the face's own normal
through P. In the cam's axes the pitch curve is z(x) = expi(-x) (C - A), so that

    z' ~ C' - i (C - A),    z'' ~ C'' - 2 i C' - (C - A),    rho = |z'|^3 / cross(z'', z')

positive where the profile is convex; a roller takes its radius from it. Of a flat face with the
angle a of its normal in the cam's axes and the distance h from A, rho = h + d^2 h / d a^2. Where
rho is not positive there the cutter has taken away what it had made: undercut.

Source: Norton, Cam Design and Manufacturing Handbook, 2nd ed. 2009, ch. 7; Dresig & Vulfson.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Annotated, Literal, NamedTuple, Protocol

from pydantic import Field, model_validator

from blockmech.couplings.contract import (
    ROUND,
    Coupling,
    Curve,
    Meshing,
    Reading,
    Touch,
    Where,
    circle,
    curvature,
    pressing,
    pressure,
)
from blockmech.couplings.laws import (
    Law,
    LawNumbers,
    Polynomial,
    Segments,
    Table,
    repeated,
    spline,
)
from blockmech.functions.roots import SCANNED, bisect
from blockmech.ground.errors import Problem
from blockmech.ground.plane import always, angle, apply, cross, dot, hyp, imul, mul
from blockmech.ground.tolerances import BLUR, EQUAL
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import NotNegative, Number, Place, PlaceGiven, default, in_unit
from blockmech.typing import Complex, Floats, Kernel, Parameters, Real


class Shape(NamedTuple):
    """What a contact reads: the follower's tip and the face's normal, in the link's axes."""

    at: Complex  # [m]
    normal: Complex  # [-] of a flat face
    roller: Real  # [m]


class CamNumbers(Protocol):
    """The law's numbers, with a `Shape`."""

    shape: Shape


class Tip(NamedTuple):
    """The tip with its derivatives by the cam's angle, as seen from the carrier."""

    C: Complex  # from A
    d: Complex
    dd: Complex
    unit: Complex  # its velocity for one unit of the driven rate


# -- a translating and a swinging follower -------------------------------------------------


def translating(pose: Meshing, at: Complex) -> Tip:
    """It moves along the guide."""
    u, F = pose.link.u, pose.motion
    return Tip(pose.link.p + u * at - pose.a.p, mul(u, F.slope), mul(u, F.curve), u)


def swinging(pose: Meshing, at: Complex) -> Tip:
    """It turns about B."""
    arm, F = pose.link.u * at, pose.motion
    across = imul(arm, 1.0)
    dd = mul(across, F.curve) - mul(arm, F.slope * F.slope)
    return Tip(pose.link.p + arm - pose.a.p, mul(across, F.slope), dd, across)


# -- where cam and follower touch -------------------------------------------------------------
#
# The relative velocity at the tip is z' turned into the carrier's axes, along the profile; the
# place of contact, a roller's radius behind it, adds what the follower turns against the cam.


def slant(motion: Complex, n: Complex) -> Real:
    """Angle [rad] from a motion, that goes with the push, to the push."""
    return angle(mul(motion, dot(motion, n)), n)


def at_tip(pose: Meshing, tip: Tip, turns: Real, slope: Real, roller: Real) -> Touch:
    """At a roller or knife edge; ``turns`` is the follower's rate per one of the cam's."""
    tangent = tip.d - imul(tip.C, 1.0)
    tangent_rate = tip.dd - imul(tip.d, 2.0) - tip.C
    size = hyp(tangent)
    n = mul(imul(tangent, 1.0), 1.0 / size)
    slip = -size - (turns - 1.0) * roller
    slope = -dot(tangent, tangent_rate) / size - slope * roller
    radius = size * size * size / cross(tangent_rate, tangent) - roller
    point = pose.a.p + tip.C - mul(n, roller)
    return Touch(point, n, tip.unit, slip, slope, slant(tip.unit, n), radius)


def translating_tip(pose: Meshing, p: CamNumbers) -> Touch:
    """Of a translating knife edge or roller."""
    return at_tip(pose, translating(pose, p.shape.at), 0.0, 0.0, p.shape.roller)


def swinging_tip(pose: Meshing, p: CamNumbers) -> Touch:
    """Of a swinging one, whose velocity at the contact is another than at the roller's centre."""
    F = pose.motion
    at = at_tip(pose, swinging(pose, p.shape.at), F.slope, F.curve, p.shape.roller)
    return at._replace(motion=imul(at.point - pose.b.p, 1.0))


def translating_face(pose: Meshing, p: CamNumbers) -> Touch:
    """Of a translating flat face: foot of P = A - i u s' on it, v = s' (u . i n) - h."""
    u, n, F = pose.link.u, pose.link.u * p.shape.normal, pose.motion
    point = foot(pose, pose.a.p - imul(u, F.slope), p)
    across, cosine = dot(u, imul(n, 1.0)), dot(u, n)
    h = dot(pose.link.p + u * p.shape.at - pose.a.p, n)
    slip, slope = F.slope * across - h, F.curve * across - F.slope * cosine
    return Touch(point, n, u, slip, slope, slant(u, n), h + F.curve * cosine)


def swinging_face(pose: Meshing, p: CamNumbers) -> Touch:
    """Of a swinging one: P on the line of centres, BP = BA / (1 - F'); g from B: v = F' g - h.

    In the radius h + h'' the derivatives are by a = q - x, of which x is no multiple.
    """
    n, d, F = pose.link.u * p.shape.normal, pose.b.p - pose.a.p, pose.motion
    w, across, depth = F.slope - 1.0, dot(d, imul(n, 1.0)), dot(d, n)
    g = dot(pose.link.p + pose.link.u * p.shape.at - pose.b.p, n)
    h, falls = g + depth, F.slope * across / w  # dh / da
    change = (F.curve * across - F.slope * F.slope * depth) / w - falls * F.curve / w
    point = foot(pose, pose.b.p + mul(d, 1.0 / w), p)
    motion = imul(point - pose.b.p, 1.0)
    slip, slope = F.slope * g - h, F.curve * g - F.slope * across
    return Touch(point, n, motion, slip, slope, slant(motion, n), h + change / w)


def foot(pose: Meshing, P: Complex, p: CamNumbers) -> Complex:
    """Foot [m] of a place on the face."""
    n = pose.link.u * p.shape.normal
    return P + mul(n, dot(pose.link.p + pose.link.u * p.shape.at - P, n))


TOUCHES = {"RP": (translating_tip, translating_face), "RR": (swinging_tip, swinging_face)}


class Outline(Law):
    """Places [m] of a profile on the cam link, once round, joined by a smooth closed curve."""

    kind: Literal["points"] = "points"
    points: Annotated[list[Place], Field(min_length=8, json_schema_extra={"unit": "m"})]

    @property
    def whole(self) -> float:
        """One turn."""
        return math.tau

    kernel = always(repeated)


class Cam(Coupling, type="coupling.cam"):
    """A cam on a crank, and a follower: a slide drive (translating) or a crank (swinging).

    law : the follower's coordinate over the cam's angle: "segments" or a "table" that repeats;
        or "points" of the profile, from which the law is computed
    follower : "knife", "roller" or "flat"
    at : [m] knife edge, centre of the roller or a place on the face, in the follower's axes
    roller : [m] radius of the roller
    face : [rad] direction of a flat face's normal, away from the cam, in the follower's axes
    friction : [-] coefficient of friction at the contact; of a roller that of its pin times the
        pin's radius over the roller's
    phase : [rad or m] follower's coordinate where the law is zero; of points, a coordinate near
        which a swinging follower is, and whose sign says which way a translating one is pushed

    The base circle follows from the positions: it touches the follower at the lowest value of the
    law.

    >>> rise = {"motion": "3-4-5", "over": 2.0, "rise": 0.01}
    >>> back = {"motion": "3-4-5", "over": 2.0, "rise": -0.01}
    >>> law = {"kind": "segments", "segments": [rise, back]}
    >>> Cam(driver="cam", driven="valve", law=law, phase=0.03).follower
    'knife'
    """

    pairs = ("RP", "RR")
    fixed = True

    law: Annotated[Segments | Polynomial | Table | Outline, Field(discriminator="kind")]
    follower: Literal["knife", "roller", "flat"] = "knife"
    at: PlaceGiven = default(Place(0j))
    roller: Annotated[NotNegative, in_unit("m")] = default(0.0)
    face: Annotated[Number, in_unit("rad")] = default(0.0)
    friction: Annotated[NotNegative, in_unit("")] = default(0.0)
    phase: Number = default(0.0)

    @model_validator(mode="after")
    def _one_profile(self) -> Cam:
        if (self.follower == "roller") != (self.roller > 0):
            message = f'the follower is "{self.follower}", the roller\'s radius {self.roller:g}'
            raise mistake("wrong-value", message, "a roller has a radius, others have none")
        if self.face and self.follower != "flat":
            raise mistake("wrong-value", f'"face" of a follower that is "{self.follower}"')
        if not self.law.whole or self.law.step:
            message = "the follower does not return to its first position after one turn"
            valid = "the profile of a cam must be closed"
            remedy = "make its last value equal its first"
            if not self.law.whole:
                remedy = 'give "period", like "360deg", without a last row that repeats the first'
            raise mistake("open-profile", message, valid, remedy)
        if self.law.advance(Fraction(1)) is None:
            message = f"the law repeats after {self.law.whole:.6g} rad, the cam after a turn"
            raise mistake("open-profile", message, "a period goes into a turn", "change the period")
        return self

    def transmission(self, pair: str) -> Kernel:
        """The kernel of the law, or of the spline through the points."""
        return self.law.kernel()

    def touch(self, pair: str) -> Callable[..., Touch]:
        """Where the follower touches the cam."""
        return TOUCHES[pair][self.follower == "flat"]

    @property
    def rubs(self) -> Real:
        """The coefficient of friction."""
        return self.friction

    def readings(self, pair: str) -> Mapping[str, Reading]:
        """Pressure angle, radius of curvature and contact force."""
        return {
            "pressure_angle": Reading("rad", pressure),
            "curvature_radius": Reading("m", curvature),
            "contact": Reading("N", pressing, of_load=True, flag="lift-off"),
        }

    def numbers(self, pair: str, at_zero: Callable[[], Meshing]) -> LawNumbers:
        """The law's numbers and the follower's shape."""
        shape = Shape(self.at.z, apply("expi", self.face), self.roller)
        if not isinstance(self.law, Outline):
            return self.law.numbers(self.phase)._replace(shape=shape)
        x, q = self._followed(pair, [p.z for p in self.law.points], at_zero(), shape)
        return spline(x, q, 5, math.tau, 0.0, 0.0)._replace(shape=shape)

    def knots(self, low: float, high: float) -> Iterable[float]:
        """The law's."""
        return self.law.within(low, high)

    def advance(self, turns: Fraction) -> Fraction | None:
        """The cam returns after every turn."""
        return Fraction(0)

    def placed(self) -> Mapping[str, str]:
        """Positions and angles of the profile and of the follower."""
        sides = {"at": "driven"} | ({"face": "driven"} if self.follower == "flat" else {})
        return sides | ({"law": "driver"} if isinstance(self.law, Outline) else {})

    # -- profile --------------------------------------------------------------------------

    def faults(self, where: str, pair: str, pose_at: Where, p: Parameters) -> Iterator[Problem]:
        """Problems: a face that cannot push, a profile through the centre, undercut."""
        touch = self.touch(pair)
        angles = [math.tau * (k + 0.5) / SCANNED for k in range(SCANNED)]
        turn = [(at, touch(at, p)) for at in map(pose_at, angles)]
        for x, (at, meets) in zip(angles, turn, strict=True):
            if abs(dot(meets.motion, meets.n)) <= BLUR * abs(meets.motion):
                message = f"at {x:.4g} rad the cam pushes at right angles to the follower's motion"
                valid = "the push needs a component along the motion"
                remedy = "turn the face, or move the follower's pivot or guide"
                yield Problem("dead-face", where, message, valid, remedy)
                return
            if dot(meets.point - at.a.p, meets.n) <= 0:
                message = f"at {x:.4g} rad the follower touches behind the cam's centre"
                remedy = "move the follower outward: its phase, its guide, or at= on the follower, "
                remedy += "which is the origin of its axes where none is given"
                valid = "the profile goes round the centre"
                yield Problem("undercut", where, message, valid, remedy)
                return

        def room(radius: float) -> float:  # negative where the profile is cut away
            return radius if self.follower == "flat" else 1 - self.roller / (radius + self.roller)

        rooms = [room(float(meets.radius)) for _, meets in turn]
        bad = [k for k in range(SCANNED) if not rooms[k] > 0]
        if not bad:
            return
        first = next((k for k in bad if rooms[k - 1] > 0), 0)
        before = angles[first] - math.tau / SCANNED
        begin = bisect(
            lambda x: room(float(touch(pose_at(x), p).radius)) > 0, before, angles[first]
        )
        radii = [meets.radius + self.roller for _, meets in turn]
        message = f"the profile is undercut from a cam angle of {begin % math.tau:.6g} rad on"
        if self.follower == "flat":
            message += f": its radius of curvature falls to {min(radii):.4g} m"
            valid, remedy = "a flat face needs a convex profile", "enlarge the base circle"
            remedy += f", by {-min(radii):.4g} m or more"
            yield Problem("undercut", where, message, valid, remedy)
            return
        smallest = min(r for r in radii if r > 0)
        valid = f"a roller smaller than {smallest:.4g} m, the smallest radius of the pitch curve"
        remedy = "use a smaller roller, a larger base circle or a longer rise"
        yield Problem("undercut", where, message, valid, remedy)

    def curves(self, pair: str, pose_at: Where, p: Parameters) -> Iterator[Curve]:
        """The profile, and the follower's roller or face."""
        lead, profile = pose_at(0.0).lead.u, []
        for k in range(2 * ROUND + 1):
            x = math.pi * k / ROUND
            at = pose_at(x)
            point = self.touch(pair)(at, p).point - at.a.p
            profile.append(point * cmath.exp(-1j * x) / lead)
        yield Curve("driver", profile)
        if pair == "RR" and self.follower != "flat":
            yield Curve("driven", [0j, self.at.z])
        if self.follower == "roller":
            yield Curve("driven", [self.at.z + z for z in circle(self.roller)[1:]])
        if self.follower == "flat":
            half = 0.5 * max(map(abs, profile)) * 1j * p.shape.normal
            yield Curve("driven", [self.at.z - half, self.at.z + half])

    def _followed(
        self, pair: str, points: Sequence[complex], at: Meshing, shape: Shape
    ) -> tuple[list[float], list[float]]:
        """The follower's coordinate over a turn of a cam that is given by points.

        Every point of the pitch curve is explicitly at one angle of the cam at the follower.
        """
        import numpy as np

        z, normal = _outline([at.lead.u * p for p in points])
        z = z + self.roller * normal
        u, D = at.link.u, at.b.p - at.a.p
        arm, n0 = u * shape.at, u * shape.normal
        C = at.link.p + arm - at.a.p
        if self.follower == "flat":
            h = (z * normal.conj()).real
            if pair == "RP":
                q = (h - dot(C, n0)) / dot(u, n0)
                x = np.angle(n0 / normal)
            else:
                q = _swung(n0, D, (h - dot(arm, n0)) / abs(D), self.phase)
                x = np.angle(n0 * np.exp(1j * q) / normal)
        elif pair == "RP":
            across, offset = C - u * dot(C, u), dot(C, u)
            sense = math.copysign(1.0, self.phase)
            q = sense * np.sqrt(abs(z) ** 2 - abs(across) ** 2) - offset
            x = np.angle((C + u * q) / z)
        else:
            excess = abs(z) ** 2 - abs(D) ** 2 - abs(arm) ** 2
            q = _swung(arm, D, excess / (2 * abs(D) * abs(arm)), self.phase)
            x = np.angle((D + arm * np.exp(1j * q)) / z)
        return _rising(np.unwrap(x)[::-1], q[::-1])


def _outline(points: Sequence[complex]) -> tuple[Floats, Floats]:
    """A closed curve through points, densely, counter-clockwise, and its outward normal."""
    import numpy as np
    from scipy.interpolate import make_interp_spline

    z = np.array([*points, points[0]])
    area = (z[:-1].conj() * z[1:]).imag.sum()
    z = z if area > 0 else z[::-1]
    t = np.concatenate([[0.0], np.cumsum(abs(np.diff(z)))])
    curve = make_interp_spline(t, np.stack([z.real, z.imag], 1), 5, bc_type="periodic")
    dense = np.linspace(0.0, t[-1], SCANNED // 2, endpoint=False)
    (x, y), (dx, dy) = curve(dense).T, curve(dense, 1).T
    tangent = dx + 1j * dy
    return x + 1j * y, -1j * tangent / abs(tangent)


def _swung(arm: complex, d: complex, cosine: Floats, start: float) -> Floats:
    """Angle by which an arm turns until its angle to d has a cosine, on the side it is near."""
    import numpy as np

    now = math.remainder(cmath.phase(arm) + start - cmath.phase(d), math.tau)
    return math.copysign(1.0, now) * np.arccos(cosine) - now + start


def _rising(x: Floats, q: Floats) -> tuple[list[float], list[float]]:
    """Rows of a table of one turn, of which none goes back; from 0 on."""
    import numpy as np

    rising = np.maximum.accumulate(x) <= x
    rising[1:] &= np.diff(np.maximum.accumulate(x)) > 0
    x, q = x[rising] % math.tau, q[rising]
    order = np.argsort(x)
    x, q = x[order], q[order]
    apart = np.append(True, np.diff(x) > EQUAL)
    return list(map(float, x[apart])), list(map(float, q[apart]))
