r"""Equilibria as records: a pose, what disturbances of it do, and all of them together.

Small disturbances x of an equilibrium obey M x'' + C x' + K x = 0: it is stable where all roots of
det(M s^2 + C s + K) stay left of or on the imaginary axis.

Source: Shabana, Dynamics of Multibody Systems, 4th ed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

import numpy as np

from blockmech.dynamics.programs import Tangents
from blockmech.figures import palette as ink
from blockmech.figures.panels import label_coordinate
from blockmech.figures.paper import Pictured, panelled, picture_unit, shown_name
from blockmech.ground.errors import refused
from blockmech.ground.plane import EPS
from blockmech.ground.report import Facts, Report, as_json, places, with_unit
from blockmech.ground.tolerances import EQUAL
from blockmech.typing import Array, Data, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Kind = Literal["stable", "unstable", "indifferent"]


PANEL = 13.0 * ink.TEXT  # [pt] height of a panel
MARKS = {"stable": ("o", "dot"), "unstable": ("^", "triangle"), "indifferent": ("s", "square")}
CLEAR = 0.02  # quantile, on either side, beyond which a picture is cut: dead centres are far off


@dataclass(frozen=True, repr=False)
class Equilibrium(Facts, Report):
    """A pose in which the loads alone move nothing.

    Attributes
    ----------
    at : ``"crank.q"`` -> coordinate [rad or m]
    units : ``"crank.q"`` -> its unit
    kind : "stable", "unstable" or "indifferent"; without friction of joints
    M, C, K : (k, k) by accelerations, rates and coordinates of the drivers
    values : (2k,) eigenvalues [1/s] of disturbances, the least damped first; empty where a
        driver moves no mass
    potential : [J] of loads that follow the only driver's coordinate, from the lowest
        equilibrium of its arc; else None
    interval : (low, high) [rad or m] around it in which friction holds the only driver, or None
    stop : whether it is at an end stop against which the loads push
    jump : whether the generalised force of the loads changes sign there by a jump
    free : coordinates of ``at`` that may have any value, as no load acts on them
    leads : beyond a dead centre of the driver, name -> value of the joint coordinate that replaces
        the driver's and to which M, C and K refer; empty elsewhere
    chart : its chart beyond a dead centre, else None
    """

    FACTS = (
        *("at", "kind", "potential", "interval", "stop", "jump", "free", "leads"),
        *("M", "C", "K", "values", "frequencies"),
    )

    at: Mapping[str, float]
    units: Mapping[str, str]
    kind: Kind
    M: Floats
    C: Floats
    K: Floats
    values: Array
    potential: float | None = None
    interval: tuple[float, float] | None = None
    stop: bool = False
    jump: bool = False
    free: tuple[str, ...] = ()
    leads: Mapping[str, float] = field(default_factory=dict)
    chart: Any = field(default=None, compare=False)

    @property
    def q(self) -> Floats:
        """Coordinates (k,) [rad or m] of the drivers."""
        return np.array([*self.at.values()])

    @property
    def stiffness(self) -> float:
        """K of the only driver [N m/rad or N/m]; for several the least of its symmetric part."""
        return float(np.linalg.eigvalsh((self.K + self.K.T) / 2)[0])

    @property
    def frequencies(self) -> Floats:
        """Natural frequencies [rad/s] of small undamped oscillations, in rising order."""
        return natural_frequencies(self.M, self.K) if len(self.values) else np.empty(0)

    def lines(self) -> Iterator[str]:
        """The equilibrium as a line."""
        fixed = {name: q for name, q in self.at.items() if name not in self.free}
        parts = [places(fixed, self.units, self._display)] if fixed else []
        at = ", ".join([*parts, *(f"{name} free" for name in self.free)])
        if self.chart is not None:
            leads = f"where {places(self.leads, self.units, self._display)} leads"
            at += f", {leads if self.leads else 'in another assembly mode'}"
        if self.stop:
            yield f"{at}  pushed against the end stop"
            return
        rows = [f"{at}  {self.kind}" + (", where the effort jumps" if self.jump else "")]
        w = self.frequencies
        if self.kind == "unstable" and len(self.values):
            rows.append(f"disturbances grow as exp({float(self.values[0].real):.6g} t)")
        elif len(w):
            rows.append(f"natural frequency {', '.join(f'{x:.6g}' for x in w)} rad/s")
        if self.potential is not None:
            rows.append(f"potential {self.potential:.6g} J")
        if self.interval is not None:
            rows.append(f"friction holds it {_between(self.interval, self._unit, self._display)}")
        yield ", ".join(rows)

    @property
    def _unit(self) -> str:
        return next(iter(self.units.values()))


class Curve(NamedTuple):
    """An arc of the only driver: places (n,), the effort of the loads, their potential or None."""

    q: Floats
    effort: Floats
    potential: Floats | None


@dataclass(frozen=True, repr=False)
class Equilibria(Facts, Pictured, Sequence[Equilibrium]):
    """All equilibria that were found, in rising order of the first driver's coordinate.

    Attributes
    ----------
    found : the equilibria without friction of joints, and the end stops
    rests : (low, high) [rad or m] of the only driver: where joint friction holds it, also where
        there is no equilibrium without it; empty without friction
    balanced : (low, high) of arcs of the only driver on which the loads are balanced everywhere
    curves : generalised force and potential of the loads on each arc of the only driver
    coordinate, unit : of the only driver, e.g. "crank.q"; "" of several
    notes : remarks for the reader
    """

    FACTS = ("rests", "balanced", "notes")

    found: tuple[Equilibrium, ...]
    rests: tuple[tuple[float, float], ...] = ()
    balanced: tuple[tuple[float, float], ...] = ()
    curves: tuple[Curve, ...] = ()
    coordinate: str = ""
    unit: str = ""
    notes: tuple[str, ...] = ()

    @overload
    def __getitem__(self, index: int) -> Equilibrium: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Equilibrium, ...]: ...
    def __getitem__(self, index: Any) -> Any:
        return self.found[index]

    def __len__(self) -> int:
        return len(self.found)

    @property
    def stable(self) -> tuple[Equilibrium, ...]:
        """The stable equilibria."""
        return tuple(e for e in self.found if e.kind == "stable")

    def figure(self, ax: Axes | None = None) -> Any:
        """Potential and effort of the loads over the only driver's coordinate.

        Raises `RequestError` of several drivers.
        """
        if not self.curves:
            message = "there is no picture of the equilibria of several drivers"
            raise refused("plot", message, "their text lists them", code="nothing-to-draw")
        factor, unit = picture_unit(self.unit, self._display)
        curves = ["potential"] * (self.curves[0].potential is not None) + ["effort of the loads"]
        counts = {kind: sum(e.kind == kind for e in self) for kind in MARKS}
        counted_kinds = (f"{n} {kind} ({MARKS[kind][1]})" for kind, n in counts.items() if n)
        caption = f"Equilibria of {shown_name(self.coordinate)}: "
        caption += ", ".join(counted_kinds) or "none"
        caption += "; shaded: where friction holds it." if self.rests else "."
        with panelled(caption, len(curves) * PANEL + 2 * ink.ROW, len(curves), ax=ax) as panels:
            for (axes,), curve in zip(panels, curves, strict=True):
                self._draw(axes, curve, factor)
            label_coordinate(axes, f"{shown_name(self.coordinate)} [{unit}]")
        return axes.figure

    def _draw(self, axes: Axes, what: str, factor: float) -> None:
        """One curve an arc, with marks at the equilibria and bands where friction holds."""
        lowest = "potential" in what
        rows = [np.asarray(c.potential if lowest else c.effort) for c in self.curves]
        finite = np.concatenate([row[np.isfinite(row)] for row in rows])
        low, high = np.quantile(finite, [CLEAR, 1 - CLEAR]) if len(finite) else (-1.0, 1.0)
        unit = "J" if lowest else f"N{' m' if self.unit == 'rad' else ''}"
        scale, unit = picture_unit(unit, self._display, max(abs(low), abs(high)))
        for curve, row in zip(self.curves, rows, strict=True):
            y = row - (np.nanmin(row) if lowest else 0.0)
            axes.plot(factor * curve.q, scale * y, color=ink.FORWARD)
            for e in self:
                q = float(e.q[0])
                if curve.q[0] <= q <= curve.q[-1]:
                    at = float(np.interp(q, curve.q, y))
                    colour = ink.ALARM if e.kind == "unstable" else ink.INK
                    axes.plot(factor * q, scale * at, MARKS[e.kind][0], ms=4, color=colour)
        for start, end in self.rests:
            axes.axvspan(factor * start, factor * end, color=ink.LINK_FILLS[1], lw=0)
        if not lowest:
            axes.axhline(0.0, color=ink.INK, lw=0.5)
            room = 0.1 * (high - low) or 1.0
            axes.set_ylim(scale * (min(low, 0.0) - room), scale * (max(high, 0.0) + room))
        axes.set_ylabel(f"{what} [{unit}]", labelpad=2)

    def lines(self) -> Iterator[str]:
        """One equilibrium a line, then the intervals of rest."""
        yield from (str(e.to(*self._display)) for e in self.found)
        if not self.found and not self.balanced:
            yield "no equilibrium"
        for one in self.balanced:
            yield f"balanced everywhere {_between(one, self.unit, self._display)}"
        for one in self.rests:
            yield f"friction holds {self.coordinate} {_between(one, self.unit, self._display)}"
        yield from self.notes

    def to_dict(self) -> Data:
        """All of it as a JSON object."""
        return {"equilibria": as_json(self.found), **super().to_dict()}


def _between(ends: tuple[float, float], unit: str, display: Sequence[str]) -> str:
    low, high = (with_unit(x, unit, display) for x in ends)
    return f"from {low} to {high}"


# -- what a pose is ------------------------------------------------------------------------


def natural_frequencies(M: Floats, K: Floats) -> Floats:
    """Natural frequencies (r,) [rad/s] of M x'' + K x = 0, rising; none of what does not swing."""
    try:
        w2 = np.linalg.eigvals(np.linalg.solve(M, K))
    except np.linalg.LinAlgError:
        return np.empty(0)
    size = float(np.abs(w2).max(initial=0.0))
    good = (w2.real > EQUAL * size) & (np.abs(w2.imag) <= math.sqrt(EQUAL) * size)
    return np.sort(np.sqrt(w2[good].real))


def companion(M: Floats, C: Floats, K: Floats) -> Floats:
    """The matrix A (2k, 2k) of (x, x')' = A (x, x'). Raises `LinAlgError` without inertia."""
    k = len(M)
    left = np.hstack([np.linalg.solve(M, K), np.linalg.solve(M, C)])
    return np.vstack([np.eye(k, 2 * k, k), -left])


def kind_of(M: Floats, C: Floats, K: Floats) -> tuple[Kind, Array]:
    """The kind of an equilibrium and the eigenvalues of its disturbances, least damped first.

    Without damping and with a symmetric K the smallest eigenvalue of K tells; an eigenvalue that
    is rounding of the largest one is none. A driver without mass follows K and C alone.
    """
    size = float(np.abs(K).max(initial=0.0))
    values: Array = np.empty(0)
    if M.any() and np.linalg.cond(M) < 1 / EPS:
        values = np.linalg.eigvals(companion(M, C, K)).astype(complex)
        values = values[np.argsort(-values.real, kind="stable")]
    symmetric = np.abs(K - K.T).max() <= EQUAL * size
    if symmetric or not len(values):
        least = float(np.linalg.eigvalsh((K + K.T) / 2)[0])
        if symmetric and least < -EQUAL * size:
            return "unstable", values
        if not np.abs(C).max() > 0 or not len(values):
            return ("stable" if least > EQUAL * size else "indifferent"), values
    slowest, largest = float(values[0].real), float(np.abs(values).max())
    if slowest > EQUAL * largest:
        return "unstable", values
    still = float(np.abs(np.linalg.eigvals(np.linalg.solve(M, K))).min()) <= EQUAL * largest**2
    return ("indifferent" if still else "stable"), values


def equilibrium_of(
    at: Mapping[str, float],
    units: Mapping[str, str],
    of: Tangents,
    i: int,
    kind: Kind | None = None,
    **facts: Any,
) -> Equilibrium:
    """The equilibrium at row i of tangents, of a kind that they tell unless it is given.

    ``facts`` are further attributes of `Equilibrium`.
    """
    M, C, K = of.M[i], of.C[i], of.K[i]
    judged = kind_of(M, C, K) if kind is None else (kind, np.empty(0))
    return Equilibrium(at, units, judged[0], M, C, K, judged[1], **facts)
