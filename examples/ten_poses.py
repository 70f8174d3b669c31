"""The paper's check: three friction iterations against converged ones, at ten poses.

Ruiz, Durango & Calle 2010 find differences below 0.1 % in the reactions at B, C and D.
"""

import math
from pathlib import Path

import numpy as np

import blockmech as bm

FILE = Path(__file__).parents[1] / "graphs" / "ruiz_fourbar.json"
REACTIONS = ("dyad.B.reaction", "dyad.C.reaction", "dyad.D.reaction")
POSES = 2 * math.pi * np.arange(10) / 10  # crank angles [rad]


def largest_differences() -> dict[str, float]:
    """Largest difference of each reaction over the poses, relative to its size there [-]."""
    fourbar = bm.Graph.load(FILE).compile()
    exact = fourbar.run(at=POSES, want=REACTIONS, friction="newton")
    three = fourbar.run(at=POSES, want=REACTIONS, friction=bm.friction.Successive(iterations=3))
    return {
        name: float(np.max(np.abs(three[name] - exact[name]) / np.abs(exact[name])))
        for name in REACTIONS
    }


if __name__ == "__main__":
    for name, difference in largest_differences().items():
        print(f"{name}: at most {100 * difference:.2g} %")
