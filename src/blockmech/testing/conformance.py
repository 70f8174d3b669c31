"""The conformance suite: does a block keep its contract?

    from blockmech.testing import conformance
    conformance("geneva.rod", example={"length": 0.2})

makes random motions and a test rig for the block and tests every numbered rule at
the head of `blockmech.blocks.contract` (of loads, couplings and friction laws: of their contracts).
What fails is named by its rule.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from blockmech.blocks.block import REGISTRY
from blockmech.blocks.contract import Block, Moving
from blockmech.couplings.contract import Coupling
from blockmech.friction.laws import LAWS, FrictionLaw
from blockmech.ground.arguments import declared
from blockmech.ground.errors import RequestError
from blockmech.loads.contract import Element
from blockmech.signals.contract import Signal
from blockmech.testing.block_rules import BlockRules
from blockmech.testing.element_rules import CouplingRules, ElementRules, SignalRules
from blockmech.testing.law_rules import LawRules
from blockmech.testing.rules import Checks, Conformance, ConformanceError
from blockmech.typing import Record

__all__ = ["Conformance", "ConformanceError", "conformance"]


RULES: dict[type, Callable[[Any], Checks]] = {
    FrictionLaw: LawRules,
    Element: ElementRules,
    Coupling: CouplingRules,
    Signal: SignalRules,
}


@declared
def conformance(
    block: str | Block | FrictionLaw, example: Record | None = None, *, seed: int = 0
) -> Conformance:
    """Test a block against the numbered rules of its contract.

    Parameters
    ----------
    block : a registered type such as ``"dyad.rrr"``, or a block itself; the same of friction laws,
        such as ``"stribeck"``
    example : parameters of the block to test, where a type is given
    seed : of the random motions; the same seed gives the same test

    Returns
    -------
    Conformance with the errors that were measured; print it

    Raises
    ------
    ConformanceError (an AssertionError) that names every rule that fails, and how
    RequestError for an unknown type

    >>> conformance("dyad.rrr", example={"l_i": 3.0, "l_j": 4.0}).name
    'dyad.rrr'
    """
    if isinstance(block, str):
        cls = REGISTRY.get(block) or LAWS.get(block)
        if cls is None:
            raise RequestError(REGISTRY.unknown(block, "conformance"))
        example_of_type: Block | FrictionLaw = cls(**(example or {}))
        block = example_of_type
    name = block.type_name or type(block).__name__
    if isinstance(block, Moving):
        return BlockRules(block, seed).report(name)
    rules = next((rules for kind, rules in RULES.items() if isinstance(block, kind)), None)
    return rules(block).report(name) if rules else Conformance(name)  # a frame has no kernels
