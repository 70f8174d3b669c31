"""Motions at the edge of what numbers can do, each with its closed form in 60 digits (mpmath)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from mpmath import mp, mpf

import blockmech as bm
from blockmech import Graph
from tests import machines
from tests.gallery import GRAPHS

DIGITS = 60
GRAVITY = 9.81  # [m/s2]


@dataclass(frozen=True)
class Motion:
    """A case of the map: where a graph is at a time [s], given what it starts from.

    slow : takes seconds or more, so it is in the map only
    truth : start coordinate, rate (mpf) -> driver -> coordinate [rad or m] at ``time``
    """

    name: str
    graph: Graph
    start: dict[str, tuple[float, float]]
    time: float
    truth: Callable[..., dict[str, Any]]
    slow: bool = False


def crank(mass: float = 1.0, arm: float = 1.0, gravity: float = GRAVITY) -> Graph:
    """A point mass on an arm [m]; it hangs at -pi/2."""
    point = bm.Link(mass=mass, inertia=0.0, cm=(arm, 0.0))
    return machines.crank(arm, point, gravity=gravity)


def slider(mass: float = 1.0) -> Graph:
    """A mass on a level guide, and a pin W on the frame at its origin."""
    g = Graph("slider")
    g.add("frame", bm.Frame(markers={"G": bm.Marker(at=0j, angle=0.0), "W": 0j}))
    g.add("slider", bm.SlideDrive(links={"slider": bm.Link(mass=mass, inertia=1.0)}))
    g.connect("frame.G", "slider.S")
    return g


def pendulum_angle(low: Any, rate: Any, t: Any) -> Any:
    """Angle from the lowest place of a pendulum of 1 m (mpf); Jacobi's functions."""
    w = mp.sqrt(mpf(GRAVITY))
    k2 = mp.sin(low / 2) ** 2 + rate**2 / (4 * w**2)
    s0 = mp.sin(low / 2)
    way = 1 if rate >= 0 else -1
    if k2 < 1:  # sin(th/2) = k sn(w t + u0)
        u0 = mp.ellipf(mp.asin(s0 / mp.sqrt(k2)), k2)
        if rate == 0:
            u0 = mp.ellipk(k2) * mp.sign(s0)
        return 2 * mp.asin(mp.sqrt(k2) * mp.ellipfun("sn", way * w * t + u0, m=k2))
    k = mp.sqrt(k2)  # it turns over: th/2 = am(k w t + u0, 1/k2)
    u0 = mp.ellipf(low / 2, 1 / k2)
    u = way * k * w * t + u0
    whole = 2 * mp.ellipk(1 / k2)
    n = mp.nint(u / whole)
    return 2 * (n * mp.pi + mp.asin(mp.ellipfun("sn", u - n * whole, m=1 / k2)))


def near_rest() -> Iterator[Motion]:
    """A pendulum let go ever nearer its highest place, and ever nearer the separatrix."""

    def truth(q: Any, rate: Any, t: Any) -> dict[str, Any]:
        return {"crank": pendulum_angle(q + mp.pi / 2, rate, t) - mp.pi / 2}

    for k in (1, 2, 4, 6, 8, 10, 12, 14):
        top = math.pi / 2 - 10.0**-k
        start = {"crank": (top, 0.0)}
        yield Motion(f"let go 1e-{k} rad from the top", crank(), start, 10.0, truth, k > 12)
    full = 2 * math.sqrt(GRAVITY)
    for k in (1, 2, 4, 6, 8, 10, 12, 14):
        for sign, words in ((-1, "below"), (1, "above")):
            rate = full * (1 + sign * 10.0**-k)
            start = {"crank": (-math.pi / 2, rate)}
            yield Motion(f"1e-{k} {words} the separatrix", crank(), start, 5.0, truth)


def stiff() -> Iterator[Motion]:
    """A mass on springs, on dampers, and under forces of all sizes."""
    for k in (0, 3, 6, 9, 12):
        for damping in (0.0, 2.0):
            g = slider()
            spring = bm.Spring(stiffness=10.0**k, free_length=0.0, damping=damping)
            _between(g, "spring", spring)

            def swings(q: Any, rate: Any, t: Any, k: int = k, c: float = damping) -> Any:
                d = mpf(c) / 2
                w = mp.sqrt(mpf(10) ** k - d**2) if mpf(10) ** k > d**2 else mpf(0)
                if w == 0:
                    return {"slider": mp.exp(-d * t) * (q + (rate + d * q) * t)}
                fading = mp.exp(-d * t)
                return {"slider": fading * (q * mp.cos(w * t) + (rate + d * q) / w * mp.sin(w * t))}

            start = {"slider": (1.0, 0.0)}
            name = f"spring 1e{k} N/m, damper {damping} N s/m"
            yield Motion(name, g, start, 1.0, swings, damping > 0 and k >= 6)
    for k in (-12, -6, 0, 3, 6, 9, 12):
        g = slider()
        _between(g, "damper", bm.Spring(stiffness=0.0, free_length=0.0, damping=10.0**k))

        def slows(q: Any, rate: Any, t: Any, k: int = k) -> Any:
            c = mpf(10) ** k
            return {"slider": q - rate / c * mp.expm1(-c * t)}

        yield Motion(f"damper 1e{k} N s/m", g, {"slider": (1.0, 1.0)}, 1.0, slows)
    for k in (-300, -100, -30, -15, 0, 15, 30, 100):
        g = slider()
        g.add("push", bm.Thrust(law=bm.laws.Constant(value=10.0**k), direction=(1.0, 0.0)))
        machines.wire(g, "frame.G push.a", "slider.slider push.b")

        def pushed(q: Any, rate: Any, t: Any, k: int = k) -> Any:
            return {"slider": q + rate * t + mpf(10.0**k) * t**2 / 2}

        yield Motion(f"force 1e{k} N", g, {"slider": (0.0, 1.0)}, 1.0, pushed, k > 30)


def _between(g: Graph, name: str, load: Any) -> None:
    g.add(name, load)
    machines.wire(g, f"frame.W {name}.a", f"slider.slider {name}.b")


def kinks() -> Iterator[Motion]:
    """A mass through a table of forces whose two knots come ever closer."""
    for k in (1, 3, 6, 9, 12, 15):
        wide = 10.0**-k
        g = slider()
        table = bm.laws.Table(
            arguments=(-10.0, 0.0, wide, 10.0), values=(0.0, 0.0, 1.0, 1.0), of="coordinate",
            interpolation="linear",
        )  # fmt: skip
        g.add("push", bm.Thrust(law=table, direction=(1.0, 0.0)))
        machines.wire(g, "frame.G push.a", "slider.slider push.b")

        def through(q: Any, rate: Any, t: Any, wide: float = wide) -> Any:
            w = mpf(wide)  # x'' = x / w between the knots
            root = mp.sqrt(1 / w)
            left = -q / rate
            inside = mp.asinh(w * root / rate) / root
            fast = rate * mp.cosh(root * inside)
            rest = t - left - inside
            return {"slider": w + fast * rest + rest**2 / 2}

        yield Motion(f"kinks 1e-{k} m apart", g, {"slider": (-0.5, 1.0)}, 1.0, through)


def ratios() -> Iterator[Motion]:
    """Masses, and the inertias of two drivers, that differ by many powers of ten."""

    def falls(q: Any, rate: Any, t: Any) -> dict[str, Any]:
        return {"crank": pendulum_angle(q + mp.pi / 2, rate, t) - mp.pi / 2}

    for k in (-18, -9, 9, 18):
        g = crank(mass=10.0**k)
        yield Motion(f"mass 1e{k} kg", g, {"crank": (0.3, 0.0)}, 3.0, falls)
    for k in (0, 6, 12, 18):
        g = crank()
        links = {"crank": bm.Link(mass=10.0**-k, inertia=0.0, cm=(1.0, 0.0))}
        g.add("other", bm.Crank(length=1.0, links=links))
        g.connect("frame.A", "other.A")

        def both(q: Any, rate: Any, t: Any) -> dict[str, Any]:
            here = falls(q, rate, t)["crank"]
            return {"crank": here, "other": here}

        start = {"crank": (0.3, 0.0), "other": (0.3, 0.0)}
        yield Motion(f"two drivers, masses 1 and 1e-{k}", g, start, 3.0, both)


def on_each_other() -> Iterator[Motion]:
    """A slide on a slide, ever lighter: of their inertia matrix the condition is the ratio."""
    for k in (0, 6, 12, 18):
        g = slider()
        g.add("rider", bm.SlideDrive(links={"slider": bm.Link(mass=10.0**-k, inertia=1.0)}))
        g.add("push", bm.Thrust(law=bm.laws.Constant(value=1.0), direction=(1.0, 0.0)))
        machines.wire(g, "slider.slider rider.S", "frame.G push.a", "slider.slider push.b")

        def stays(q: Any, rate: Any, t: Any) -> dict[str, Any]:
            return {"slider": t**2 / 2, "rider": -(t**2) / 2}  # the rider is left behind

        start = {"slider": (0.0, 0.0), "rider": (0.0, 0.0)}
        yield Motion(f"a slide of 1e-{k} kg on one of 1 kg", g, start, 1.0, stays)


def rubbing() -> Iterator[Motion]:
    """Slides on guides with Coulomb friction: almost none, as much as almost holds, and in pairs.

    A slide goes down a slope. Two are thrown up one, and turn at one moment or almost.
    """
    for k in (16, 12, 8, 4, 0):
        g = slope(0.5, 0.5 * 10.0**-k)
        yield Motion(f"friction 0.5e-{k} down a slope", g, {"slider": (0.0, 0.0)}, 1.0, _down(g))
    for k in (1, 4, 8, 12):
        g = slope(0.5, math.tan(0.5) * (1 - 10.0**-k))
        name = f"friction 1e-{k} short of holding on a slope"
        yield Motion(name, g, {"slider": (0.0, 0.0)}, 1.0, _down(g))
    for later in (0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3):
        g = slope(0.5, 0.2)
        add_slide(g, "other", 0.2)
        start = {"slider": (0.0, -1.0), "other": (0.0, -1.0 - later)}
        name = f"two pairs turn, their speeds {later:.0e} apart"
        yield Motion(name, g, start, 1.0, _up_and_down(g, start))


def slope(angle: float, friction: float) -> Graph:
    """A mass on a guide that falls with an angle [rad]."""
    g = Graph("slope", gravity=(0.0, -GRAVITY))
    g.add("frame", bm.Frame(markers={"G": bm.Marker(at=0j, angle=-angle)}))
    return add_slide(g, "slider", friction)


def add_slide(g: Graph, name: str, friction: float) -> Graph:
    """One more mass on the same guide."""
    law = {"S": bm.friction.Coulomb(coefficient=friction)}
    body = bm.Link(mass=1.0, inertia=1.0)
    g.add(name, bm.SlideDrive(links={"slider": body}, friction=law))
    g.connect("frame.G", f"{name}.S")
    return g


def _pulls(g: Graph) -> tuple[Any, Any]:
    """Acceleration [m/s2] along a slope by gravity, and what friction takes of it."""
    frame: Any = g.blocks["frame"]
    slider: Any = g.blocks["slider"]
    angle, f = mpf(frame.markers["G"].angle), mpf(slider.friction["S"].coefficient)
    return -mpf(GRAVITY) * mp.sin(angle), mpf(GRAVITY) * f * mp.cos(angle)


def _down(g: Graph) -> Callable[..., dict[str, Any]]:
    def truth(q: Any, rate: Any, t: Any) -> dict[str, Any]:
        along, friction = _pulls(g)
        return {"slider": q + (along - friction) * t**2 / 2}

    return truth


def _up_and_down(g: Graph, start: dict[str, tuple[float, float]]) -> Callable[..., dict[str, Any]]:
    def truth(q: Any, rate: Any, t: Any) -> dict[str, Any]:
        along, friction = _pulls(g)
        positions = {}
        for name, (_, thrown) in start.items():
            turns = -mpf(thrown) / (along + friction)  # it comes to a stop, and slides back
            top = mpf(thrown) * turns / 2
            positions[name] = top + (along - friction) * (t - turns) ** 2 / 2
        return positions

    return truth


# [s] of the pump's steady turn, to more digits than a motion knows it by: J w w' + J' w^2 / 2 = tau
# for the rate w(q), solved by Fourier collocation at 97 and 121 points in mpmath, which agree in
# 31 digits, from the slider-crank's own closed form.
PUMP_PERIOD = "0.1020467664516839220711779875373171"


def long() -> Iterator[Motion]:
    """The pump of the gallery for hours: ten seconds, and whole turns of its steady state."""
    g = bm.Graph.load(GRAPHS / "pump.json")
    mechanism = g.compile()

    @cache
    def settled() -> tuple[Any, Any]:
        early = mechanism.simulate("time=10").motion
        start = {"crank": (early.q_end, early.qd_end)}
        return early, mechanism.simulate("turns=1", start=start).motion

    for k in (2, 3, 4):

        def turned(q: Any, rate: Any, t: Any) -> dict[str, Any]:
            early, turn = settled()
            many, rest = divmod(mpf(t) - 10, mpf(PUMP_PERIOD))
            last = mpf(float(turn.at(float(rest)).q))
            return {"crank": last + many * 2 * mp.pi * math.copysign(1.0, early.qd_end)}

        start = {d: (x.q, x.rate) for d, x in mechanism.scene.initial.items()}
        yield Motion(f"pump over 1e{k} s", g, start, 10.0**k, turned, k < 4)


def all_motions() -> list[Motion]:
    """Every case of the map."""
    return [*near_rest(), *stiff(), *kinks(), *ratios(), *on_each_other(), *rubbing(), *long()]


@dataclass(frozen=True)
class Cell:
    """What a motion gave: error, estimate and way [rad or m], cost, and what the user is told."""

    error: float
    estimate: float
    way: float
    evaluations: int
    seconds: float
    told: str

    @property
    def is_answer(self) -> bool:
        """Whether it gives a number for the time asked for."""
        return math.isfinite(self.error)


def moved(case: Motion) -> Cell:
    """Run a case, and compare its end with the truth."""
    start = time.process_time()
    run = case.graph.compile().simulate(
        f"time={case.time!r}", start=case.start, times=[case.time]
    )  # fmt: skip
    m, error = run.motion, math.nan
    if m.end == "time" and m.status != "failed":
        with mp.workdps(DIGITS):
            first = next(iter(case.start.values()))
            truth = case.truth(mpf(first[0]), mpf(first[1]), mpf(case.time))
            off = [abs(mpf(float(run[f"{d}.q"][-1])) - there) for d, there in truth.items()]
            error = float(max(off))
    summary = "; ".join([f"{m.method}, {m.status}: {m.end} at {m.t_end:.3g} s", *m.notes])
    way = float(np.abs(np.subtract(m.q_end, m.at(m.t_start).q)).max())
    return Cell(error, m.error, way, m.cost.evaluations, time.process_time() - start, summary)
