"""Poses beside change points on branches that follow, and joints almost in one place.

Where a pin is, and how fast, against its closed form in 60 digits (mpmath).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from mpmath import mp, mpf

import blockmech as bm
from blockmech.ground.errors import BlockmechError
from tests import machines

DIGITS = 60
CRANK, ROD = 0.25, 0.5  # [m] of the parallelogram
LONG, ROCKER, GROUND = 2.5, 2.0, 2.5  # [m] of the four-bar whose crank is short


@dataclass(frozen=True)
class Near:
    """A case of the map.

    pin : name of the output of its place and, with ``v`` for ``p``, of its velocity
    truth : crank angle (mpf) -> the pin's place [m] and its derivative
    allowed : relative errors of place and velocity that half an ulp of the data leaves
    """

    name: str
    mechanism: Callable[[], Any]
    angle: float
    pin: str
    truth: Callable[[Any], tuple[Any, Any]]
    allowed: tuple[float, float]


@dataclass(frozen=True)
class Cell:
    """Relative errors of place and velocity, NaN where it was refused, and what was told."""

    place: float
    velocity: float
    told: str

    @property
    def is_answer(self) -> bool:
        """Whether it gives numbers."""
        return math.isfinite(self.place + self.velocity)


def parallelogram() -> Any:
    """A parallelogram whose dyad follows the motion; it is flat at 0 and pi."""
    home: Any = {"drivers": {"crank": math.pi / 2}, "branch": 1}
    return machines.fourbar(CRANK, ROD, CRANK, ROD, branch="follow", home=home).compile()


def short_crank(length: float) -> Any:
    """A four-bar of links and joints whose crank has its pins almost in one place."""
    m = bm.Linkage("short crank")
    m.add_link("crank", pose=(0.0, 0.0, 0.4))
    m.add_link("rod", pose=(1.7, 1.83, 3.96))  # its origin at C
    m.add_link("rocker", pose=(GROUND, 0.0, 1.98))
    m.add_joint("A", "R", ["frame", "crank"], at=[(0.0, 0.0), (0.0, 0.0)])
    m.add_joint("B", "R", ["crank", "rod"], at=[(length, 0.0), (LONG, 0.0)])
    m.add_joint("C", "R", ["rod", "rocker"], at=[(0.0, 0.0), (ROCKER, 0.0)])
    m.add_joint("D", "R", ["frame", "rocker"], at=[(GROUND, 0.0), (0.0, 0.0)])
    m.add_driver("crank", "A")
    return m.compile()


def cases() -> Iterator[Near]:
    """Every case of the map."""

    def translated(q: Any) -> tuple[Any, Any]:
        turning = mpf(CRANK) * mp.expj(q)
        return turning + mpf(ROD), 1j * turning

    for k in (1, 2, 4, 6, 8, 10, 12):
        d = 10.0**-k
        for where, angle in (("beyond", d), ("before", -d)):
            allowed = 2.0**-52 / d, 2.0**-52 / d**2
            name = f"parallelogram 1e-{k} rad {where} its change point"
            yield Near(name, parallelogram, angle, "dyad.C.p", translated, allowed)
    for k in (1, 3, 6, 9, 12, 15):
        length = 10.0**-k

        def circles(q: Any, length: float = length) -> tuple[Any, Any]:
            B, D = mpf(length) * mp.expj(q), mpf(GROUND)
            r = abs(D - B)
            along = (mpf(LONG) ** 2 - mpf(ROCKER) ** 2 + r**2) / (2 * r)
            across = mp.sqrt(mpf(LONG) ** 2 - along**2)
            C = B + (along + 1j * across) * (D - B) / r
            u, w, v = C - B, C - D, 1j * B  # v . u = (i om w) . u
            om = (v.real * u.real + v.imag * u.imag) / (w.real * u.imag - w.imag * u.real)
            return C, 1j * om * w

        made = lambda length=length: short_crank(length)  # noqa: E731
        name = f"four-bar, crank 1e-{k} m long, of links and joints"
        yield Near(name, made, 0.4, "link.rod.p", circles, (2.0**-52, 2.0**-52))


def found(case: Near) -> Cell:
    """Run a case, and compare it with its closed form."""
    try:
        mechanism = case.mechanism()
        (_driver,) = mechanism.drivers
        names = [case.pin, case.pin.removesuffix("p") + "v"]
        r = mechanism.run(at=[case.angle], rates=1.0, want=names, on_gap="mark")
    except BlockmechError as error:
        return Cell(math.nan, math.nan, "refused: " + ", ".join(p.code for p in error.problems))
    with mp.workdps(DIGITS):
        truth = case.truth(mpf(case.angle))
        got = [mp.mpc(complex(r[name][0])) for name in names]
        off = [float(abs(a - b) / abs(b)) for a, b in zip(got, truth, strict=True)]
    told = [*r.quality.status, *(flag.code for flag in r.quality.flags)]
    return Cell(*off, ", ".join(dict.fromkeys(told)))
