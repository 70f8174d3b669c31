"""Where single precision stops being usable: measured over the margins that were met."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.analysis.trade.errors import Yardstick

if TYPE_CHECKING:
    from blockmech.analysis.trade.sweep import Sweep

USABLE = 1e-3  # relative error up to which single precision is worth having
DECADE = 10.0


def where_it_stops(sweep: Sweep, stick: Yardstick) -> tuple[str, ...]:
    """What single precision keeps at each decade of the margin, as sentences.

    The error of a sample is the largest over the outputs. The margin of a sample is the
    smallest of its groups.
    """
    result = sweep.given(precision="complex64", engine="numpy")
    columns = list(result.quality.margin.values())
    if not columns:
        return ()
    margin = stick.picked(np.min([np.asarray(c, dtype=float) for c in columns], axis=0))
    worst = np.zeros(len(margin))
    for error in stick.each(result).values():
        if len(error) == len(worst):
            worst = np.maximum(worst, error.astype(float))
    rows = by_decade(margin[stick.good], worst[stick.good])
    if not rows:
        return ()
    kept = [f"{error:.1g} at margins from {low:.1g}" for low, error in rows]
    text = f"single precision, worst error: {', '.join(kept[:6])}"
    bad = [low for low, error in rows if error > USABLE]
    if bad:
        stop = max(bad) * DECADE
        return (f"{text}; it stops being usable (error above {USABLE:g}) below a margin of "
                f"{min(stop, 1.0):.1g}",)  # fmt: skip
    smallest = float(margin[stick.good].min())
    return (f"{text}; it is usable down to the smallest margin met, {smallest:.2g}",)


def by_decade(margin: Any, error: Any) -> list[tuple[float, float]]:
    """Worst error in each decade of the margin: (lower end, error), from the largest down."""
    decade = np.floor(np.log10(np.maximum(margin, 1e-300)))
    return [
        (DECADE**k, float(error[decade == k].max()))
        for k in sorted(set(decade.tolist()), reverse=True)
    ]
