"""Pictures of sensitivities: for each output its numbers as bars, the strongest above."""

from __future__ import annotations

from typing import Any

from blockmech.draw import palette as ink
from blockmech.draw.paper import captioned, scaled_unit, shown_name
from blockmech.studies.sensitivity import SHOWN, Effect, Sensitivity

PANELS = 6  # outputs that one picture can hold
THICK = 0.62  # of a row: a bar


def sensitivity_figure(sensitivity: Sensitivity, degrees: bool) -> Any:
    """The ranked bars of the first outputs, a column wide."""
    ranked = {name: _moving(sensitivity, name) for name in list(sensitivity)[:PANELS]}
    heights = [(len(effects) + 3.5) * ink.ROW for effects in ranked.values()]
    n = sensitivity.result.n
    over = "one sample" if n == 1 else f"{n} samples"
    caption = (
        f"{shown_name(sensitivity.result.mechanism.name, 40)}: largest change of an output over "
        f"{over} by a hundredth of a number, of a zero by that of the largest of its unit. "
        "Blue: both grow together; orange, hatched: one shrinks; grey: a vector."
    ) + sensitivity.doubts_text(ranked)
    with captioned(caption, sum(heights) + ink.ROW / 2) as figure:
        panels = figure.subplots(len(ranked), height_ratios=heights, squeeze=False)[:, 0]
        for axes, (name, effects) in zip(panels, ranked.items(), strict=True):
            _bars(axes, name, sensitivity.unit_of(name), effects)
    return figure


def _moving(sensitivity: Sensitivity, name: str) -> list[Effect]:
    """The strongest numbers of an output, without those that do nothing."""
    ranked = sensitivity.ranked(name)[:SHOWN]
    return [e for e in ranked if e.change > 0.0] or ranked[:1]


def _bars(axes: Any, name: str, unit: str, effects: list[Effect]) -> None:
    factor, scaled = scaled_unit(unit, effects[0].change)
    for row, e in enumerate(effects):
        if isinstance(e.derivative, complex):
            style: dict[str, Any] = {"color": ink.GREY}
        elif e.derivative > 0:
            style = {"color": ink.FORWARD}
        else:
            style = {"facecolor": ink.PAPER, "edgecolor": ink.BACK, "hatch": "/////", "lw": 0.8}
        axes.barh(row, factor * e.change, height=THICK, **style)
    axes.set_yticks(range(len(effects)), [e.parameter.address for e in effects])
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    axes.set_xlabel(f"{name}: change by 1 % [{scaled or '–'}]", labelpad=1)
    axes.grid(True, axis="x")
    axes.spines[["top", "right"]].set_visible(False)
