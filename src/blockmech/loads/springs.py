"""Linear springs, with or without damping: between two markers, or between two links.

A spring's force acts along the line from a to b: ``k (L - L0) + c L'`` pulls a towards b and
b towards a. A torsional spring has the angle theta of b relative to a, less the rest angle,
and in (-pi, pi]: the moment on b is ``-k theta - c theta'``, and the opposite on a. Whole
turns are not counted: half a turn from rest the moment changes its sign.

Sources: [D14] Durango et al. 2014, section 2 (loads as functions of position and
velocity).
"""

from __future__ import annotations

import math
from typing import Annotated

from blockmech.ground.plane import angle, dot, expi, hyp, mul, where
from blockmech.ground.values import Angle, Axis, NotNegative, Number, Units, default, in_unit
from blockmech.loads.actuators import distance, tension
from blockmech.loads.contract import Element, Kinks, Terminal, acts
from blockmech.typing import Complex, Kernel, Real


def pull(p_a: Complex, p_b: Complex, p: Spring) -> tuple[Complex, Complex]:
    """Forces [N] on a and on b; NaN where the ends meet and k L0 > 0."""
    d = p_b - p_a
    F = mul(d, p.stiffness - pressed(d, p))
    return F, -F


def pressed(d: Complex, p: Spring) -> Real:
    """k L0 / L [N/m]; nothing, wherever the ends are, of a spring without free length."""
    force = p.stiffness * p.free_length
    return force / where(force == 0.0, 1.0, hyp(d))


def pull_and_damp(
    p_a: Complex, v_a: Complex, p_b: Complex, v_b: Complex, p: Spring
) -> tuple[Complex, Complex]:
    """The same with damping c L' along the line.

    Ends that meet pass each other along their relative velocity, which is the line's limit.
    """
    d, v = p_b - p_a, v_b - v_a
    square = dot(d, d)
    meet = square == 0.0
    strain_rate = dot(v, d) / where(meet, 1.0, square)
    stretch = p.stiffness - pressed(d, p) + p.damping * strain_rate
    F = mul(d, stretch) + mul(v, where(meet, p.damping, 0.0))
    return F, -F


def stored(p_a: Complex, p_b: Complex, p: Spring) -> Real:
    """Energy [J] of the spring, k (L - L0)^2 / 2."""
    stretch = hyp(p_b - p_a) - p.free_length
    return p.stiffness * stretch * stretch / 2


class Spring(Element, type="load.spring"):
    """A linear spring between markers a and b; with stiffness 0 a linear damper.

    stiffness [N/m], free_length [m], damping [N s/m] along the line.

    >>> Spring(stiffness=100.0, free_length=0.2).reads()
    {'a': ('p',), 'b': ('p',)}
    """

    terminals = {"a": Terminal("point"), "b": Terminal("point")}

    stiffness: Annotated[Number, in_unit("N/m")]
    free_length: Annotated[NotNegative, in_unit("m")] = default(0.0)
    damping: Annotated[NotNegative, in_unit("N s/m")] = default(0.0)

    @property
    def conservative(self) -> bool:
        """Without damping."""
        return not acts(self.damping)

    @property
    def line(self) -> tuple[Kernel, Kernel]:
        """Its length, and its tension."""
        return distance, tension

    def kernel(self) -> Kernel:
        """Spring force, with damping only if there is any, as that needs velocities."""
        return pull_and_damp if acts(self.damping) else pull

    def energy(self) -> Kernel | None:
        """The stored energy, if it is elastic."""
        return stored if acts(self.stiffness) else None


def twist(e_a: Complex, e_b: Complex, p: TorsionSpring) -> Real:
    """Angle [rad] of b relative to a, less the rest angle, in (-pi, pi]."""
    return angle(e_a * expi(p.rest_angle), e_b)


def turn_back(e_a: Complex, e_b: Complex, p: TorsionSpring) -> tuple[Real, Real]:
    """Moments [N m] on a and on b."""
    M = p.stiffness * twist(e_a, e_b, p)
    return M, -M


def turn_back_and_damp(
    e_a: Complex, om_a: Real, e_b: Complex, om_b: Real, p: TorsionSpring
) -> tuple[Real, Real]:
    """The same with damping."""
    M = p.stiffness * twist(e_a, e_b, p) + p.damping * (om_b - om_a)
    return M, -M


def damp(om_a: Real, om_b: Real, p: TorsionSpring) -> tuple[Real, Real]:
    """Damping alone, a torsional damper."""
    M = p.damping * (om_b - om_a)
    return M, -M


def stored_by_turning(e_a: Complex, e_b: Complex, p: TorsionSpring) -> Real:
    """Energy [J] of the spring, k theta^2 / 2."""
    theta = twist(e_a, e_b, p)
    return p.stiffness * theta * theta / 2


class TorsionSpring(Element, type="load.torsion_spring"):
    """A torsional spring between links a and b; with stiffness 0 a torsional damper.

    stiffness [N m/rad], rest_angle [rad] of b relative to a, damping [N m s/rad].

    >>> TorsionSpring(stiffness=0.0, damping=2.0).reads()
    {'a': ('om',), 'b': ('om',)}
    """

    terminals = {"a": Terminal("link"), "b": Terminal("link")}

    stiffness: Annotated[Number, in_unit("N m/rad")]
    rest_angle: Angle = default(0.0)
    damping: Annotated[NotNegative, in_unit("N m s/rad")] = default(0.0)

    def units(self, axis: Axis) -> Units:
        """Units along the axis; on a sliding joint of a document it acts as a linear spring."""
        stiffness, damping = (axis.coefficient(of) for of in ("coordinate", "rate"))
        return {"stiffness": stiffness, "rest_angle": axis.coordinate, "damping": damping}

    @property
    def conservative(self) -> bool:
        """Without damping."""
        return not acts(self.damping)

    def kinks(self) -> Kinks | None:
        """The half turn from rest, where the moment changes its sign."""
        return Kinks(twist, (math.pi,), turning=True) if acts(self.stiffness) else None

    def kernel(self) -> Kernel:
        """The cheapest equivalent formula for the moment."""
        if not acts(self.damping):
            return turn_back
        return turn_back_and_damp if acts(self.stiffness) else damp

    def energy(self) -> Kernel | None:
        """The stored energy, if it is elastic."""
        return stored_by_turning if acts(self.stiffness) else None
