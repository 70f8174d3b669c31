"""Motions in the chart of their drivers alone: up to its dead centre, where others lead on."""

from __future__ import annotations

from typing import Any

from blockmech.compiled import Compiled
from blockmech.dynamics.change_points import system_of
from blockmech.dynamics.methods import move
from blockmech.dynamics.request import request_of
from blockmech.plan.settings import friction_asked
from blockmech.result.motion import Motion


def in_one_chart(
    mechanism: Compiled, until: str, engine: str = "auto", friction: Any = None, **asked: Any
) -> Motion:
    """The motion that `simulate` has as long as one chart serves."""
    request, _ = request_of(mechanism.scene, mechanism._coordinate_units, until, **asked)
    how = friction_asked(friction)
    return move(system_of(mechanism, method=how, engine=engine), request)
