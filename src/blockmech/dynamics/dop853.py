"""SciPy's DOP853, many steps at a time by machine code where that is asked.

Coefficients (attributes of SciPy's class), estimate and control are SciPy's own.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 1993, II.5, II.10.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853

from blockmech.dynamics.equation import Equation
from blockmech.dynamics.motion import Floats
from blockmech.dynamics.system import REPORTED
from blockmech.engines.stages import Steps, scheme


class Dop853(DOP853):  # type: ignore[misc]
    """The method on an `Equation`, whose rates at the start are known.

    By machine code nothing of SciPy's is needed but its coefficients: the rest is made for the
    first step that it cannot do.
    """

    t: float
    y: Floats
    f: Floats
    h_abs: float

    def __init__(
        self,
        equation: Equation,
        t0: float,
        y0: Floats,
        bound: float,
        *,
        slope: Floats,
        rtol: Floats,
        atol: Floats,
        max_step: float,
    ) -> None:
        self.equation, self.begun = equation, False
        self.t, self.y, self.f, self.t_old = t0, y0, slope, None
        self.t_bound, self.max_step, self.status = bound, max_step, "running"
        self.tolerances = np.array([rtol, atol])
        self.h_abs = self._first_step()

    def _first_step(self) -> float:
        """The step [s] to try first, as SciPy's methods do.

        Source: Hairer, Norsett & Wanner, II.4, starting step size.
        """
        y, f, (rtol, atol) = self.y, self.f, self.tolerances
        scale, longest = atol + np.abs(y) * rtol, self.t_bound - self.t

        def size(x: Floats) -> float:
            x = x / scale
            return math.sqrt(float(x @ x) / x.size)

        far, fast = size(y), size(f)
        h = min(1e-6 if far < 1e-5 or fast < 1e-5 else 0.01 * far / fast, longest)
        bends = size(np.asarray(self.equation(self.t + h, y + h * f)) - f) / h
        quick = max(fast, bends)
        fits = (0.01 / quick) ** (1 / (self.error_estimator_order + 1)) if quick > 1e-15 else 0.0
        return min(100 * h, fits or max(1e-6, 1e-3 * h), longest, self.max_step)

    def step(self) -> str | None:
        """One step, by SciPy."""
        if not self.begun:
            rtol, atol = self.tolerances
            how = {"rtol": rtol, "atol": atol, "max_step": self.max_step}
            h = min(self.h_abs, self.t_bound - self.t)
            super().__init__(self.equation, self.t, self.y, self.t_bound, first_step=h, **how)
            self.begun = True
        failed: str | None = super().step()
        return failed

    def steps(self, free_range: tuple[float, float], every: bool) -> AcceptedSteps | None:
        """The next steps by machine code, up to one that may leave a free_range; None without any.

        every : whether a standstill ends a step
        """
        code, by = self.equation.code, scheme()
        if code is None:
            return None
        begin, ends = (self.t, self.y), (self.t_bound, self.max_step)
        left = (self.equation.most - self.equation.spent) / len(by.C)
        most = int(min(REPORTED, left + 1))
        made = code.steps(begin, self.h_abs, ends, free_range, self.tolerances, most, every)
        many = len(made.K)
        more = len(by.C) - self.n_stages - 1
        self.equation.took(1 + made.tried * self.n_stages + many * more)
        if not many:
            return None
        self.t_old, self.t = made.t[-2:].tolist()
        self.y_old, self.y = made.y[-2:]
        self.h_abs, self.f = made.h, made.K[-1, self.n_stages, : self.y.size].copy()
        self.h_previous = float(made.t[-1] - made.t[-2])
        self.status = "finished" if self.t >= self.t_bound else "running"
        calm, turns = many - made.doubtful, []
        if not every:
            rate = made.K[:calm, :, 0]
            signs = (rate * rate[:, self.n_stages, None] <= 0) & (rate != 0)
            turns = signs.any(axis=1).nonzero()[0].tolist()
        return AcceptedSteps(made.t, made.y, Dense.of(made), calm, turns)


class AcceptedSteps(NamedTuple):
    """Steps, one after the other.

    t : (m + 1,) [s], y : (m + 1, n) where they begin, and where the last ends
    dense : states (n, ...) at times (...): at one, or (p,)
    calm : in how many, the first ones, nothing happens for sure but standstills
    turns : in which of those the only driver may stand still
    """

    t: Floats
    y: Floats
    dense: Callable[[Any], Any]
    calm: int = 0
    turns: Sequence[int] = ()

    def part(self, first: int, end: int) -> AcceptedSteps:
        """Some of them."""
        dense = self.dense.part(first, end) if isinstance(self.dense, Dense) else self.dense
        return self._replace(t=self.t[first : end + 1], y=self.y[first : end + 1], dense=dense)

    def until(self, t: float, y: Any) -> AcceptedSteps:
        """The same, the last to another end."""
        return self._replace(t=np.append(self.t[:-1], t), y=np.vstack([self.y[:-1], y]))


@dataclass(frozen=True)
class Dense:
    """Dense output of steps that begin at t (m,) and last h (m,) [s], see `powers_of`.

    series : (8, m, n)
    """

    t: Floats
    h: Floats
    series: Floats

    @classmethod
    def of(cls, steps: Steps) -> Dense:
        """From the rates at their stages."""
        t, y, K, n = steps.t, steps.y, steps.K, steps.y.shape[1]
        h, moved, series = t[1:] - t[:-1], y[1:] - y[:-1], np.empty((8, len(K), n))
        series[:4] = h[:, None] * (DOP853.D[::-1] @ K)[..., :n].swapaxes(0, 1)
        first, last = h[:, None] * K[:, 0, :n], h[:, None] * K[:, DOP853.n_stages, :n]
        series[4], series[5] = 2 * moved - last - first, first - moved
        series[6], series[7] = moved, y[:-1]
        return cls(t[:-1], h, series)

    @classmethod
    def joined(cls, times: Sequence[float], pieces: Sequence[Dense]) -> Dense:
        """That of pieces, each from one of the times [s] to the next.

        What a piece knows of steps beyond is left out.
        """
        if len(pieces) == 1:
            return pieces[0]
        kept = []
        for piece, end in zip(pieces, times[1:], strict=True):
            m = max(int(piece.t.searchsorted(end)), 1)
            kept.append((piece.t[:m], piece.h[:m], piece.series[:, :m]))
        t, h, series = zip(*kept, strict=True)
        return cls(np.concatenate(t), np.concatenate(h), np.concatenate(series, axis=1))

    def part(self, first: int, end: int) -> Dense:
        """That of some steps."""
        return Dense(self.t[first:end], self.h[first:end], self.series[:, first:end])

    @cached_property
    def _first(self) -> tuple[float, float, list[list[float]]]:
        """Begin, length and series (n, 8) of the first step as numbers."""
        return float(self.t[0]), float(self.h[0]), self.series[:, 0].T.tolist()

    def __call__(self, t: Any) -> Floats:
        if np.ndim(t):
            i: Any = self.t[1:].searchsorted(t) if len(self.t) > 1 else 0
            series = self.series.take(i, axis=1) if np.ndim(i) else self.series
            return powers_of((t - self.t[i]) / self.h[i], series).T
        if len(self.t) > 1 and (k := int(self.t[1:].searchsorted(t))):
            return self.part(k, k + 1)(t)
        begin, h, series = self._first
        x = (float(t) - begin) / h
        z = 1.0 - x  # as `powers_of`, a component after the other
        return np.array(
            [
                ((((((a * x + b) * z + c) * x + d) * z + e) * x + f) * z + g) * x + last
                for a, b, c, d, e, f, g, last in series
            ]
        )


def powers_of(x: Any, series: Floats) -> Floats:
    """Dense output (p, n) at shares x (p,) of steps, from their series (8, p, n).

    They are those of z z z x, z z z, z z x, z z, z x, z, x, 1, with z = x (1 - x).
    """
    factors = 1 - x[:, None], x[:, None]
    powers: Floats = series[0] * factors[1] + series[1]
    for k, row in enumerate(series[2:]):
        powers *= factors[k % 2]
        powers += row
    return powers
