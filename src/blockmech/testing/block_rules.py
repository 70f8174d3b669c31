"""The numbered rules of a block with links, tested on random motions in which it closes.

The rules stand at the head of `blockmech.blocks.contract`. Kernels are called with
motions of their joints and held against each other and against differences; the rig
(`blockmech.testing.rig`) puts the block into a mechanism for the rest.
"""

from __future__ import annotations

from blockmech.testing.block_trial import BlockTrial
from blockmech.testing.calling_rules import batches, impossible, inputs, not_a_number, outputs
from blockmech.testing.force_rules import balances, forces
from blockmech.testing.kinematic_rules import accelerations, positions, velocities


class BlockRules(BlockTrial):
    """Rules 1 to 10."""

    rules = {
        "rule 1 (inputs are declared)": inputs,
        "rule 2 (outputs depend on inputs and parameters only)": outputs,
        "rule 3 (positions close the joints)": positions,
        "rule 4 (velocities)": velocities,
        "rule 5 (accelerations)": accelerations,
        "rule 6 (reactions)": forces,
        "rule 7 (batches)": batches,
        "rule 8 (NaN in, NaN out)": not_a_number,
        "rule 9 (impossible samples)": impossible,
        "rule 10 (balances)": balances,
    }
