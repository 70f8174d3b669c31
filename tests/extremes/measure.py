"""Measured digits of a scene: error of an engine against what noise in the data forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np

from blockmech.engines.numpy import PRECISIONS

from .precise import DIGITS, Precise, half_ulp, rounded
from .scenes import Scene

SHAKES = 6  # times that all parameters are moved by half an ulp


@dataclass(frozen=True)
class Row:
    """Worst output of one kind in a scene.

    error : relative to the largest of its kind in the scene [-]
    forced : what half an ulp in the parameters does to it, relative likewise [-]
    """

    scene: str
    precision: str
    kind: str
    error: float
    forced: float
    margin: float

    @property
    def digits(self) -> float:
        """Correct digits."""
        return float(-np.log10(self.error)) if self.error > 0 else float("inf")


def measure(scene: Scene, precision: str) -> list[Row]:
    """One row for each kind of output (p, v, a, omega, alpha, reaction, drive)."""
    mechanism = scene.graph.compile()
    precise = Precise(mechanism if scene.twin is None else scene.twin.compile(), scene.want)
    result = mechanism.run(
        at=scene.at,
        rates=scene.rates,
        want=scene.want,
        friction="none",
        engine="numpy",
        precision=precision,
        on_gap="mark",
    )
    inputs = {name: float(np.asarray(column)[0]) for name, column in result.samples.inputs.items()}
    dtype = PRECISIONS[precision]
    truth = precise.values(inputs, rounded(dtype))
    shaken = [precise.values(inputs, half_ulp(k, dtype)) for k in range(SHAKES)]
    rows = []
    for kind in sorted({name.rsplit(".", 1)[-1] for name in scene.want}):
        names = [n for n in precise.plan.want if n.endswith(f".{kind}") and n in result]
        with mpmath.workdps(DIGITS):
            scale = max((abs(truth[n][0]) for n in names), default=mpmath.mpf(0))
            if scale == 0:
                continue
            error = max(abs(_number(result[n][0]) - truth[n][0]) for n in names)
            forced = max(abs(s[n][0] - truth[n][0]) for s in shaken for n in names)
            relative = float(error / scale), float(forced / scale)
        margin = min((float(m[0]) for m in result.quality.margin.values()), default=1.0)
        rows.append(Row(scene.name, precision, kind, *relative, margin))
    return rows


def _number(x: Any) -> Any:
    return mpmath.mpc(complex(x)) if np.iscomplexobj(x) else mpmath.mpf(float(x))
