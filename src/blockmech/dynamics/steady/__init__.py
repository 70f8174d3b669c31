"""The steady state of a scene: what its motion settles to, whatever sort of scene it is.

| the loads follow               | looked for by                                              |
|--------------------------------|------------------------------------------------------------|
| the time, and repeat           | stroboscopic map (`stroboscope`)                            |
| place and rate, one driver     | return map (`return_map`); a rotation by `collocation`      |
| place and rate, several drivers | the equilibrium at which it comes to rest (`settling`)       |
| the place alone                | every motion is its own: `conserved`                        |
"""

from __future__ import annotations

from blockmech.dynamics.steady.conserved import conserved
from blockmech.dynamics.steady.search import steady_motion, steady_motions

__all__ = ["conserved", "steady_motion", "steady_motions"]
