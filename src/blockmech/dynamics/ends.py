"""What ends a motion before its goal: names that all methods share, and where each begins."""

from __future__ import annotations

from typing import Final

END_STOP: Final = "end stop"
DEAD_CENTRE: Final = "dead centre"
IMPOSSIBLE: Final = "impossible pose"
NO_INERTIA: Final = "no inertia"
UNDEFINED_LOAD: Final = "undefined load"
INTERRUPTED: Final = "interrupted"  # by the user; what was done is kept
TOO_MANY: Final = "more evaluations than allowed"

LEAST_MARGIN = 1e-6  # [-] at which a run is stopped: a dead centre is near
LEAST_INERTIA = 1e-9  # [-] of a typical one, at which it is: the speed goes without bound
