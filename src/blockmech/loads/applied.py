"""Applied loads: a force at a marker, constant or by a law, and a constant couple on a link.

Sources: [R10] Ruiz, Durango & Calle 2010, Fig. 5 (external forces F_i, F_j, moments M_i, M_j).
[D14] Durango et al. 2014, section 2 (loads as functions of position and velocity).
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import model_validator

from blockmech.ground.plane import always, dot, hyp, mul
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import (
    DIRECTED,
    Number,
    VectorOrNoneGiven,
    default,
    in_unit,
)
from blockmech.loads.contract import Element, Following, LawGiven, Terminal
from blockmech.typing import Complex, Kernel, Real


def ground_force(p: Force) -> tuple[Complex]:
    """The constant force [N] in ground axes."""
    return (p.force,)


def link_force(e_at: Complex, p: Force) -> tuple[Complex]:
    """The constant force [N] turned with the link, e_at its unit x axis."""
    return (e_at * p.force,)


def ground_force_by_law(F: Real, p: Force) -> tuple[Complex]:
    """The law's force [N] along a direction in ground axes."""
    return (mul(p.direction, F / hyp(p.direction)),)


def link_force_by_law(e_at: Complex, F: Real, p: Force) -> tuple[Complex]:
    """The law's force [N] along a direction that turns with the link."""
    return (mul(e_at * p.direction, F / hyp(p.direction)),)


def ground_coordinate(p_at: Complex, p: Force) -> Real:
    """Coordinate [m] of the point along the direction, from the origin."""
    return dot(p_at, p.direction) / hyp(p.direction)


def link_coordinate(p_at: Complex, e_at: Complex, p: Force) -> Real:
    """The same along the direction on the link, as it points in this pose."""
    return dot(p_at, e_at * p.direction) / hyp(p.direction)


def ground_speed(v_at: Complex, p: Force) -> Real:
    """Velocity [m/s] of the point along the direction."""
    return dot(v_at, p.direction) / hyp(p.direction)


def link_speed(v_at: Complex, e_at: Complex, p: Force) -> Real:
    """The same along the direction on the link."""
    return dot(v_at, e_at * p.direction) / hyp(p.direction)


class Force(Following, type="load.force"):
    """A force [N] at marker ``at``: a constant vector ``force``, or a law along ``direction``.

    Both are in ground axes, or turn with the link (``axes="link"``). The law's coordinate [m]
    is that of the point along the direction, from the origin, its rate [m/s] the point's
    velocity along it; with ``driver`` they are that driver's. Centrifugal force away from the
    y axis is ``Force(direction=(1, 0), law=laws.Polynomial(coefficients=[0, m * w**2]))``.

    >>> Force(force=(0.0, -1000.0)).axes
    'ground'
    >>> Force(direction=(1.0, 0.0), law=lambda time: 30.0 * time).reads()
    {'time': ('t',)}
    """

    coordinate_text = "coordinate of the point along the direction, from the origin [m]"
    coordinate_symbol = "at"
    terminals = {"at": Terminal("point")}

    force: Annotated[VectorOrNoneGiven, in_unit("N")] = default(None)
    direction: Annotated[VectorOrNoneGiven, DIRECTED] = default(None)
    law: LawGiven | None = None
    axes: Literal["ground", "link"] = "ground"

    @model_validator(mode="after")
    def _constant_or_law(self) -> Force:
        by_law = self.law is not None, self.direction is not None
        if by_law != (self.force is None,) * 2:
            keys = ("force", "direction", "law")
            present = [key for key in keys if getattr(self, key) is not None]
            message = f"has {' and '.join(present) or 'neither force nor law'}"
            raise mistake("wrong-value", message, "", 'give "force", or "direction" and "law"')
        return self

    @property
    def link_vectors(self) -> tuple[str, ...]:
        """Force and direction, where they turn with the link."""
        return ("force", "direction") if self.axes == "link" else ()

    @property
    def conservative(self) -> bool:
        """True in ground axes for a constant force (a weight) or one of its own coordinate."""
        positional = set(self.variables()) <= {"coordinate"} and self.driver is None
        return self.axes == "ground" and positional

    def measure_kernel(self, rate: bool) -> Kernel:
        """The point's coordinate along the direction, or its velocity along it."""
        if self.axes == "link":
            return link_speed if rate else link_coordinate
        return ground_speed if rate else ground_coordinate

    def kernel(self) -> Kernel:
        """The force in the axes that the user chose."""
        if self.law is None:
            return link_force if self.axes == "link" else ground_force
        return link_force_by_law if self.axes == "link" else ground_force_by_law


def couple(p: Couple) -> tuple[Real]:
    """The constant moment [N m]."""
    return (p.moment,)


class Couple(Element, type="load.couple"):
    """A constant moment [N m] on the link ``on``, counter-clockwise positive.

    >>> Couple(moment=-250.0).moment
    -250.0
    """

    terminals = {"on": Terminal("link")}

    moment: Annotated[Number, in_unit("N m")]

    kernel = always(couple)
