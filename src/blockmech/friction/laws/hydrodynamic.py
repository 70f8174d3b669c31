r"""A journal on its oil film: in the middle of it by Petroff's equation, or loaded by a table f(S).

    couple = 2 pi viscosity radius^3 length / clearance * rate

holds for a light load or a high speed, where the journal is concentric. A journal that a load W
presses aside has by Sommerfeld's number S, with N = rate / 2 pi revolutions a second, the
coefficient f of

    S = (radius / clearance)^2 viscosity N (2 radius length) / W,     F(S) = (radius / clearance) f

F, the friction variable, is a table of the bearing's shape: charts of Raimondi & Boyd, or a closed
form. It begins at S = 0, the journal at rest or pressed through its film, with the boundary
friction there, so that no motion leaves it; beyond its last row friction follows S, as it does
of a journal in the middle. Between the rows it is a monotone cubic.

The couple clearance W F(S_1 / W), with S_1 = S W, is not linear in the load. Its tangent is: a
factor clearance (F - S F') and a drag clearance S_1 F'.

Sources: Petroff, Friction in machines and the effect of the lubricant, 1883; Raimondi & Boyd, A
solution for the finite journal bearing, ASLE Transactions 1 (1958), 159-209; as in Shigley's
Mechanical Engineering Design, ch. 12. Fritsch & Carlson 1980 (the cubic, through SciPy).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field, model_validator

from blockmech.friction.laws.contract import FrictionLaw, FrictionTerms
from blockmech.ground.plane import apply, minimum, piecewise, where
from blockmech.ground.validation_errors import check_table, mistake
from blockmech.ground.values import Length, Number, NumbersGiven, default, in_unit
from blockmech.typing import Parameters, Real

THICKEST = 0.01  # [-] of the radius: a film of journal bearings is a thousandth of it


class FilmNumbers(NamedTuple):
    """Numbers of a film with a table."""

    viscosity: Real
    radius: Real
    length: Real
    clearance: Real
    steepest: Real  # [m] of the couple by the load
    last: Real  # S of the last row
    beyond: Real  # F / S there
    boundary: Real  # F at rest
    knots: tuple[Real, ...]  # S of the rows
    rows: tuple[tuple[Real, ...], ...]  # coefficients of F, highest power first
    slopes: tuple[tuple[Real, ...], ...]  # of its derivative


def petroff(speed: Real, p: Parameters) -> FrictionTerms:
    """The shear stress of the film over the journal's surface, times its radius."""
    area = 2.0 * math.pi * p.radius * p.length
    stress = p.viscosity * (speed * p.radius / p.clearance)
    return FrictionTerms(0.0 * speed, stress * area * p.radius)


def loaded_film(speed: Real, load: Real, p: FilmNumbers) -> FrictionTerms:
    """Tangent of the couple over the load."""
    slender = p.radius / p.clearance
    by_load = slender * slender * p.viscosity * (speed / math.tau) * (2.0 * p.radius * p.length)
    beyond = by_load > p.last * load
    S = minimum(where(beyond, p.last, by_load / where(load > 0.0, load, 1.0)), p.last)
    F = where(beyond, p.beyond * S, piecewise(S, p.knots, p.rows))
    slope = where(beyond, p.beyond, piecewise(S, p.knots, p.slopes))
    return FrictionTerms(p.clearance * (F - S * slope), p.clearance * by_load * slope)


def boundary(p: FilmNumbers) -> FrictionTerms:
    """At rest."""
    return FrictionTerms(p.clearance * p.boundary, 0.0)


class Hydrodynamic(FrictionLaw):
    """A journal bearing: lightly loaded by Petroff's equation, or with a table of its shape.

    viscosity : [Pa s] dynamic viscosity of the oil
    radius, length : [m] of the journal
    clearance : [m] radial
    sommerfeld : [-] numbers S, rising from 0; none for Petroff's equation
    friction_variable : [-] (radius / clearance) f at each S; at 0 that of boundary friction

    >>> oil = Hydrodynamic(viscosity=0.02, radius=0.025, length=0.05, clearance=2.5e-5)
    >>> round(oil.at(100.0).drag, 6)
    0.392699
    >>> table = {"sommerfeld": [0.0, 0.1, 1.0], "friction_variable": [0.0, 3.0, 20.5]}
    >>> loaded = Hydrodynamic(**oil.model_dump(exclude=set(table)), **table)
    >>> factor, drag = loaded.at(100.0, load=5000.0)  # of the tangent there
    >>> round(factor * 5000.0 + drag, 6)
    0.559078
    """

    law: Literal["hydrodynamic"] = "hydrodynamic"
    kinds: ClassVar[tuple[str, ...]] = ("R",)
    viscosity: Annotated[Number, Field(gt=0), in_unit("Pa s")]
    radius: Length
    length: Length
    clearance: Length
    sommerfeld: NumbersGiven = default([])
    friction_variable: NumbersGiven = default([])

    @model_validator(mode="after")
    def _thin(self) -> Hydrodynamic:
        if self.clearance > THICKEST * self.radius:
            share = self.clearance / self.radius
            found = f'"clearance" {self.clearance:g} m is {share:.3g} of the radius'
            valid = f"Petroff's equation is for films up to {THICKEST:g} of the radius"
            raise mistake("bad-friction", found, valid, "give the radial clearance in m")
        return self

    @model_validator(mode="after")
    def _from_rest_on(self) -> Hydrodynamic:
        S, F = self.sommerfeld, self.friction_variable
        check_table("sommerfeld", S, F, called="friction_variable")
        if len(S) and not (len(S) > 1 and S[0] == 0.0 and min(F) >= 0.0 and F[-1] > 0.0):
            found = f'"sommerfeld" begins at {S[0]:g}, "friction_variable" at {F[0]:g}'
            valid = "a table has at least two rows, the first at S = 0, and no negative friction"
            remedy = "add the row at S = 0: (radius / clearance) times the coefficient at rest"
            raise mistake("bad-friction", found, valid, remedy)
        return self

    @property
    def smooth(self) -> bool:
        """Not with a table."""
        return not len(self.sommerfeld)

    def parameters(self) -> Parameters:
        """The numbers, of a table with its cubics."""
        if self.smooth:
            return super().parameters()
        n, S, F = len(self.sommerfeld), list(self.sommerfeld), list(self.friction_variable)
        steepest, *flat = apply("one_by_one", _cubics, *S, *F)
        parts = [tuple(flat[i : i + n - 1]) for i in range(0, len(flat), n - 1)]
        own = self.viscosity, self.radius, self.length, self.clearance
        edges = S[-1], F[-1] / S[-1], F[0]
        table = tuple(S), tuple(parts[:4]), tuple(parts[4:])
        return FilmNumbers(*own, self.clearance * steepest, *edges, *table)

    def kernel(self) -> Callable[..., FrictionTerms]:
        """`petroff`, or `loaded_film` with a table."""
        return petroff if self.smooth else loaded_film

    def kernel_at_rest(self) -> Callable[..., FrictionTerms] | None:
        """`boundary` with a table."""
        return None if self.smooth else boundary


def _cubics(*table: float) -> tuple[float, ...]:
    """Largest |F - S F'|, and coefficients (7, rows - 1) of F and F', from S and F of all rows."""
    from scipy.interpolate import PchipInterpolator

    n = len(table) // 2
    curve = PchipInterpolator(table[:n], table[n:])
    slope, bends = curve.derivative(), curve.derivative(2).roots(extrapolate=False)
    S = [*table[:n], *bends[bends == bends]]  # F - S F' has the slope -S F'', straight pieces NaN
    tangents = abs(curve(S) - S * slope(S))
    return (float(tangents.max()), *map(float, curve.c.ravel()), *map(float, slope.c.ravel()))
