"""A linear spring, with or without damping, between two markers.

The force acts along the line from a to b: ``k (L - L0) + c L'`` pulls a towards b
and b towards a.

Sources: [D14] Durango et al. 2014, section 2 (loads as functions of position and
velocity).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from blockmech.loads.contract import Element, Terminal
from blockmech.plane import dot, hyp, mul, where
from blockmech.typing import Complex, Real
from blockmech.values import NotNegative, Number, in_unit


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
    along = dot(v, d) / where(meet, 1.0, square)
    stretch = p.stiffness - pressed(d, p) + p.damping * along
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
    free_length: Annotated[NotNegative, in_unit("m")] = 0.0
    damping: Annotated[NotNegative, in_unit("N s/m")] = 0.0

    def kernel(self) -> Callable[..., Any]:
        """With damping where there is any: only that asks for velocities."""
        return pull_and_damp if self.damping else pull

    def energy(self) -> Callable[..., Any] | None:
        """The stored energy, if it is elastic."""
        return stored if self.stiffness else None
