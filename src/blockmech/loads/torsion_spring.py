"""A torsional spring, with or without damping, between two links.

With theta the angle of b relative to a, less the rest angle, and in (-pi, pi], the
moment on b is ``-k theta - c theta'``, and the opposite on a. Whole turns are not
counted: half a turn from rest the moment changes its sign.

Sources: [D14] Durango et al. 2014, section 2 (loads as functions of position and
velocity).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from blockmech.loads.contract import Element, Terminal
from blockmech.plane import angle, expi
from blockmech.typing import Complex, Real
from blockmech.values import Angle, Axis, NotNegative, Number, Units, in_unit


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


def stored(e_a: Complex, e_b: Complex, p: TorsionSpring) -> Real:
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
    rest_angle: Angle = 0.0
    damping: Annotated[NotNegative, in_unit("N m s/rad")] = 0.0

    def units(self, axis: Axis) -> Units:
        """Those along the axis: on a sliding joint of a document it is a spring along it."""
        stiffness, damping = (axis.coefficient(of) for of in ("coordinate", "rate"))
        return {"stiffness": stiffness, "rest_angle": axis.coordinate, "damping": damping}

    def kernel(self) -> Callable[..., Any]:
        """The cheapest form that says the same."""
        if not self.damping:
            return turn_back
        return turn_back_and_damp if self.stiffness else damp

    def energy(self) -> Callable[..., Any] | None:
        """The stored energy, if it is elastic."""
        return stored if self.stiffness else None
