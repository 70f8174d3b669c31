"""Synthesis: mechanisms for a task, as graphs.

`path_generator` (a coupler point passes points, with or without timing), `function_generator` (a
rocker follows a function of the crank's angle) and `body_guidance` (a coupler passes positions)
propose four-bars. `chains` are all kinematic chains of a number of links.

Every design is checked: from the first position to the last the crank turns in one sense, the
linkage closes everywhere, and the dyad keeps its branch. Other designs are left out.

Sources: Sandor & Erdman, Advanced Mechanism Design, vol. 2, ch. 2 and 3; Norton, Design of
Machinery, 6th ed., ch. 5 (circuit, branch and order defects).
"""

from __future__ import annotations

from blockmech.synthesis.designs import Design, Synthesis, fourbar, saved
from blockmech.synthesis.fourbar import coupler_point
from blockmech.synthesis.over_structures import Candidate, Candidates, path_over_structures
from blockmech.synthesis.structures import Structure, chains, mechanisms, structures
from blockmech.synthesis.tasks import (
    body_guidance,
    burmester_pins,
    function_generator,
    path_generator,
    three_positions,
)

__all__ = [
    "Candidate",
    "Candidates",
    "Design",
    "Structure",
    "Synthesis",
    "body_guidance",
    "burmester_pins",
    "chains",
    "coupler_point",
    "fourbar",
    "function_generator",
    "mechanisms",
    "path_generator",
    "path_over_structures",
    "saved",
    "structures",
    "three_positions",
]
__dir__ = __all__.copy  # completion shows these alone
