"""Mass, inertia and centre of mass of links from their shapes.

A `Body` is what a link takes: ``bm.Link(**bm.design.shapes.bar(0.4, mass=1.2))``,
``linkage.add_link("rod", bm.design.shapes.bar("400 mm", mass=1.2))``. Bodies add up, and holes are
taken away: ``plate - disc.at(0.1, 0.0)``. Everything is about an axis normal to the plane of
motion.

Sources: Norton, Design of Machinery, section 10 (composite bodies, parallel axes); polygons by
Green's theorem (Steger, On the calculation of arbitrary moments of polygons, 1996).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from blockmech.ground.errors import Problem, RequestError
from blockmech.ground.units import number_in_si
from blockmech.typing import Quantity

UNITS = {"mass": "kg", "density": "kg/m3", "area": "m2"}  # other sizes are lengths [m]
STEEL = 7850.0  # [kg/m3]


@dataclass(frozen=True)
class Body:
    """Mass properties in the plane, as a link takes them by ``**``.

    Attributes
    ----------
    mass : [kg]
    inertia : [kg m2] about the centre of mass
    cm : (x, y) [m] centre of mass in the link's frame
    """

    mass: float
    inertia: float
    cm: tuple[float, float] = (0.0, 0.0)

    def keys(self) -> tuple[str, ...]:
        """Names of the properties, for ``**``."""
        return ("mass", "inertia", "cm")

    def __getitem__(self, name: str) -> Any:
        return getattr(self, name)

    def at(self, x: float, y: float, angle: float = 0.0) -> Body:
        """The body turned by an angle [rad] about the origin, then moved by x, y [m]."""
        centre = complex(*self.cm) * complex(math.cos(angle), math.sin(angle)) + complex(x, y)
        return Body(self.mass, self.inertia, (centre.real, centre.imag))

    def __add__(self, body: Body) -> Body:
        return self._with(body, 1)

    def __sub__(self, hole: Body) -> Body:
        return self._with(hole, -1)

    def _with(self, body: Body, sign: int) -> Body:
        """Both as one: centres by moments, inertias by parallel axes."""
        mass = self.mass + sign * body.mass
        if not mass > 0:
            message = f"{self.mass:.9g} kg less {body.mass:.9g} kg leave no mass"
            raise RequestError([Problem("bad-value", "shapes", message, "", "take less away")])
        a, b = complex(*self.cm), complex(*body.cm)
        cm = (self.mass * a + sign * body.mass * b) / mass
        inertia = self.inertia + self.mass * abs(a - cm) ** 2
        inertia += sign * (body.inertia + body.mass * abs(b - cm) ** 2)
        return Body(mass, inertia, (cm.real, cm.imag))


def point(mass: Quantity, at: Sequence[float] = (0.0, 0.0)) -> Body:
    """A point mass [kg] at a place (x, y) [m], such as a bolt or a counterweight."""
    return Body(_positive(mass=mass)[0], 0.0, (float(at[0]), float(at[1])))


def bar(length: Quantity, width: Quantity = 0.0, **amount: Quantity) -> Body:
    """A bar from the origin along x; ``width`` [m] in the plane, without it a slender rod.

    Parameters
    ----------
    length : [m]
    amount : ``mass=`` [kg], or ``thickness=`` [m] and ``density=`` [kg/m3] (steel)

    >>> import blockmech as bm
    >>> bm.design.shapes.bar(0.5, mass=1.5).inertia
    0.03125
    """
    x, y = _positive("width", length=length, width=width)
    mass = _mass(x * y, amount)
    return Body(mass, mass * (x**2 + y**2) / 12, (x / 2, 0.0))


def plate(width: Quantity, height: Quantity, **amount: Quantity) -> Body:
    """A rectangle about the origin, ``width`` [m] along x and ``height`` [m] along y."""
    x, y = _positive(width=width, height=height)
    mass = _mass(x * y, amount)
    return Body(mass, mass * (x**2 + y**2) / 12)


def disc(radius: Quantity, inner: Quantity = 0.0, **amount: Quantity) -> Body:
    """A disc about the origin, or a ring with an inner radius [m].

    >>> import blockmech as bm
    >>> bm.design.shapes.disc(0.5, mass=2.0).inertia
    0.25
    """
    r, hole = _positive("inner", radius=radius, inner=inner)
    _positive(wall=r - hole)
    mass = _mass(math.pi * (r**2 - hole**2), amount)
    return Body(mass, mass * (r**2 + hole**2) / 2)


def polygon(outline: Iterable[Sequence[float]], **amount: Quantity) -> Body:
    """The area within corners (x, y) [m], in either sense of rotation."""
    z = np.array([complex(*corner) for corner in outline])
    if len(z) < 3 or not np.isfinite(z).all():
        message = f"got {len(z)} corners"
        raise RequestError([Problem("bad-value", "outline", message, "three or more, finite", "")])
    origin = z.mean()  # about which little cancels
    a, b = z - origin, np.roll(z, -1) - origin
    cross = (a.conjugate() * b).imag
    area = cross.sum() / 2
    if not abs(area) > np.finfo(float).eps * np.abs(a).max() ** 2 * len(z):
        raise RequestError([Problem("bad-value", "outline", "it encloses no area", "", "")])
    cm = ((a + b) * cross).sum() / (6 * area)
    second = (cross * (np.abs(a) ** 2 + (a.conjugate() * b).real + np.abs(b) ** 2)).sum() / 12
    mass = _mass(abs(float(area)), amount)
    inertia = mass * (float(second / area) - abs(cm) ** 2)
    centre = complex(cm + origin)
    return Body(mass, inertia, (centre.real, centre.imag))


def _mass(area: float, amount: dict[str, Quantity]) -> float:
    """Mass [kg] of an area [m2]: as it is given, or of a thickness and a density."""
    if amount.keys() == {"mass"}:
        return _positive(**amount)[0]
    if "thickness" in amount and amount.keys() <= {"thickness", "density"}:
        return math.prod(_positive(area=area, **{"density": STEEL, **amount}))
    message = f"got {', '.join(amount) or 'neither'}"
    valid = "mass=, or thickness= and density= (steel)"
    raise RequestError([Problem("bad-request", "shapes", message, valid, "say how much it is")])


def _positive(zero: str = "", /, **sizes: Quantity) -> list[float]:
    """Sizes in SI; refuses those not above zero, all at once, but for one that may be zero."""
    units = {name: UNITS.get(name, "m") for name in sizes}
    numbers = {
        name: math.nan if isinstance(x, bool) else number_in_si(x or 0.0, units[name])
        for name, x in sizes.items()
    }
    RequestError.raise_for(
        Problem("bad-value", name, f"must be > 0, got {sizes[name]!r}", f"it is in {units[name]}")
        for name, x in numbers.items()
        if not (0 < x < math.inf or (x == 0 and name == zero))
    )
    return [*numbers.values()]
