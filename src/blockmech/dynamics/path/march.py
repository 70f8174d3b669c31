r"""The energy equation with speed-dependent loads, panel by panel along the path.

    dK/dx = T(x, w),      w = sqrt(2 K / J),      dt = dx / w

is one smooth scalar equation for K(x): nothing is stepped in time. On a panel of
Chebyshev nodes

    K_i = K_left + (L/2) sum_j I_ij T(x_j, w_j)

is solved by Newton's method. A start from rest is walked in sqrt(x), in which the
energy and the speed are analytic.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.dynamics.chebyshev import Floats, remainder, rule
from blockmech.dynamics.path.mesh import Mesh, View
from blockmech.dynamics.path.patches import Patch, Path
from blockmech.dynamics.path.quadrature import (
    AVERAGED,
    EPS,
    ROUNDING,
    TIMED,
    Quadrature,
    largest_speed,
)

NEWTON_STEPS = 12
SPEED_STEP = 1e-6  # relative step of a difference quotient in the speed
STARTS = 24  # lengths tried for the first panel of a start from rest
MOST_PANELS = 20_000
SLOW = 1e-3  # share of the largest energy below which a falling motion is handed over


class Panel(NamedTuple):
    """A solved panel; arrays (n,) over its nodes."""

    patch: Patch
    shift: float  # [rad or m] whole turns before it
    K: Floats  # [J]
    F: Floats  # [s/rad, s/m] dt/dv
    tau: Floats  # [N m or N] the whole effort, for the panel's coordinate v
    K_end: float  # [J]
    duration: float  # [s]
    truncation: float  # [s] error of the time from the end of its series
    lost: float  # [J] error of the energy at its end, from series and rounding
    slowing: float  # [s/J] how much time a joule less makes
    fading: float  # [-] what is left at its end of an energy error at its beginning


class March(NamedTuple):
    """Panels one after the other, and why there are no more."""

    panels: list[Panel]
    reason: Literal["done", "slow", "gap", "limit"]


Done = Callable[[float, float], bool]  # (x, elapsed) -> whether the march may end


def effort(view: View, patch: Patch, shift: float, speed: Floats) -> Floats:
    """The whole effort T(x, w) along growing x, (n,) [N m or N]."""
    whole = patch.tau - patch.damping * speed
    if view.meter.system.rate_load is not None:
        rates = view.meter.rate_load(view.q(patch.x + shift), view.sign * speed)
        whole = whole + view.sign * rates
    return np.asarray(whole)


def effort_slope(view: View, patch: Patch, shift: float, speed: Floats, here: Floats) -> Floats:
    """dT/dw (n,): exact for linear damping, else by a difference quotient."""
    if view.meter.system.rate_load is None:
        return -patch.damping
    step = SPEED_STEP * (speed + 1e-3 * speed.max())
    return np.asarray((effort(view, patch, shift, speed + step) - here) / step)


def solved(view: View, patch: Patch, shift: float, K_left: float, guess: Floats) -> Panel | None:
    """The energy on a panel by Newton's method, or None where it finds none above zero."""
    r = rule(patch.J.size)
    half = patch.length / 2
    K = guess
    for _ in range(NEWTON_STEPS):
        speed = np.sqrt(2 * K / patch.J)
        here = effort(view, patch, shift, speed)
        residual = K - K_left - half * ((here * patch.slope) @ r.integrate)
        gain = effort_slope(view, patch, shift, speed, here) * patch.slope / (patch.J * speed)
        change = np.linalg.solve(np.eye(K.size) - half * r.integrate.T * gain, residual)
        if not np.isfinite(change).all():
            return None
        K, size = corrected(K, change)
        if size < 1e-9:  # the next step, which is not made, would be its square
            break
    else:
        return None
    speed = np.sqrt(2 * K / patch.J)
    tau = effort(view, patch, shift, speed) * patch.slope
    K = K_left + half * (tau @ r.integrate)
    K_end = K_left + half * float(tau @ r.total)
    if not (K_end > 0 and K.min() > 0):
        return None
    F = patch.slope / np.sqrt(2 * K / patch.J)
    return Panel(
        patch=patch,
        shift=shift,
        K=K,
        F=F,
        tau=tau,
        K_end=K_end,
        duration=half * float(F @ r.total),
        truncation=half * float(remainder(F, r)),
        lost=half * (float(remainder(tau, r)) + ROUNDING * float(np.abs(tau) @ r.total)),
        slowing=half / 2 * float((F / K) @ r.total),
        fading=math.exp(min(half * float(gain @ r.total), 50.0)),
    )


def march(
    path: Path,
    K0: float,
    effort0: float,
    tolerance: float,
    done: Done,
    into: list[Panel] | None = None,
) -> March:
    """March from x = 0 with energy K0 [J] until ``done`` or until the motion slows down.

    ``effort0`` [N m or N] is that at the start; ``tolerance`` [-] the relative error of a
    panel's time and energy above which it is halved. Panels are added to ``into`` as they
    are solved, so they are not lost where ``done`` raises.
    """
    view, n = path.view, path.n
    panels: list[Panel] = [] if into is None else into
    x, K, elapsed, largest = 0.0, K0, 0.0, K0
    if K0 == 0:
        first = _from_rest(path, effort0, tolerance)
        if first is None:
            return March(panels, "slow")
        panels.append(first)
        x, K, elapsed, largest = first.patch.high, first.K_end, first.duration, first.K_end
    while not done(x, elapsed):
        if len(panels) >= MOST_PANELS:
            return March(panels, "limit")
        patch, shift = path.at(x)
        if not patch.possible:
            if path.halve(x):
                continue
            return March(panels, "gap")
        panel = solved(view, patch, shift, K, np.full(n, K))
        if panel is None or not _resolved(panel, tolerance):
            if path.halve(x):
                continue
            if panel is None:
                return March(panels, "slow")
        if panel.K_end < min(K, SLOW * largest):
            return March(panels, "slow")
        panels.append(panel)
        x, K = patch.high + shift, panel.K_end
        elapsed += panel.duration
        largest = max(largest, K)
    return March(panels, "done")


def _from_rest(path: Path, effort0: float, tolerance: float) -> Panel | None:
    panel = None
    for halvings in range(STARTS):
        patch = path.start(halvings)
        if not patch.possible:
            continue
        panel = solved(path.view, patch, 0.0, 0.0, effort0 * patch.x)
        if panel is not None and _resolved(panel, tolerance):
            break
    return panel


def _resolved(panel: Panel, tolerance: float) -> bool:
    in_time = panel.truncation <= tolerance * panel.duration
    return in_time and panel.lost <= (tolerance + 4 * EPS) * float(panel.K.max())


def errors(panels: list[Panel], origin: float) -> tuple[float, float]:
    """Error of the time over a march [s], and of the energy at its end [J].

    ``origin`` [rad or m] is the driver coordinate at x = 0: samples are taken at rounded
    coordinates, and the energy is rounded as it is carried from panel to panel.
    """
    seconds, joules = 0.0, 0.0
    for panel in panels:
        q = abs(origin) + panel.patch.high + panel.shift
        rounded = EPS * float(panel.K.max()) + AVERAGED * EPS * q * float(np.ptp(panel.tau))
        within = joules * max(1.0, panel.fading) + panel.lost
        # from a standstill on the energy is rounded relative to what it is
        slowing = panel.duration / panel.K_end if panel.patch.root else panel.slowing
        seconds += panel.truncation + panel.slowing * within + slowing * rounded
        seconds += TIMED * EPS * panel.duration
        joules = joules * panel.fading + panel.lost + rounded
    return seconds, joules


def as_quadrature(panels: list[Panel]) -> Quadrature:
    """A march as a quadrature, for its dense output."""
    edges = np.array([0.0] + [p.patch.high + p.shift for p in panels])
    durations = np.array([p.duration for p in panels])
    tau, J = np.array([p.tau for p in panels]), np.array([p.patch.J for p in panels])
    K, F = np.array([p.K for p in panels]), np.array([p.F for p in panels])
    J = J * np.array([p.patch.slope for p in panels]) ** 2
    none, no = np.zeros(len(panels)), np.zeros(len(panels), dtype=bool)
    mesh = Mesh(
        edges=edges,
        both=np.array([J, tau]),
        missed=np.zeros((2, len(panels))),
        length=np.array([p.patch.length for p in panels]),
        limits=(panels[0].patch.root, False),
        margin=np.ones(J.shape),
    )
    return Quadrature(
        mesh=mesh,
        mirrored=no,
        ended=no,
        K_start=K[:, 0],
        J=J,
        tau=tau,
        K=K,
        F=F,
        duration=durations,
        clock=np.concatenate([[0.0], np.cumsum(durations)]),
        closure=np.zeros(0),
        truncation=none,
        lost=none,
        rounded=none,
        lost_time=0.0,
        rounded_time=0.0,
        doubted=none,
        owned=np.zeros(len(panels), dtype=np.intp),
        fastest=largest_speed(J, K),
    )


def corrected(K: Floats, change: NDArray[np.floating[Any]]) -> tuple[Floats, float]:
    """Kinetic energies less a Newton step, kept positive; and the relative size of the step."""
    new = np.where(change < K, K - change, K / 4)
    return new, float(np.abs(new - K).max() / new.max())
