"""Static and kinetic friction: a pair at rest holds more than one that slips.

Source: Armstrong-Helouvry, Dupont & Canudas de Wit, A survey of models ... for the control of
machines with friction, Automatica 30 (1994), 1083-1138, section 2.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from pydantic import model_validator

from blockmech.friction.laws.contract import FrictionTerms
from blockmech.friction.laws.coulomb import DryFriction
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import NotNegative
from blockmech.typing import Parameters


def kinetic(p: Parameters) -> FrictionTerms:
    """While the pair slips."""
    return FrictionTerms(p.kinetic * p.arm, 0.0)


def static(p: Parameters) -> FrictionTerms:
    """While it does not."""
    return FrictionTerms(p.static * p.arm, 0.0)


class Stiction(DryFriction):
    """Coulomb friction with a larger coefficient at rest.

    static : [-] largest coefficient of the pair at rest
    kinetic : [-] coefficient while it slips

    >>> law = Stiction(static=0.3, kinetic=0.2, radius=0.1)
    >>> round(law.at(1.0).factor, 6), round(law.at_rest().factor, 6)
    (0.02, 0.03)
    """

    law: Literal["stiction"] = "stiction"
    static: NotNegative
    kinetic: NotNegative

    @model_validator(mode="after")
    def _holds_no_less(self) -> Stiction:
        check_static(self.static, self.kinetic)
        return self

    def kernel(self) -> Callable[..., FrictionTerms]:
        """`kinetic`."""
        return kinetic

    def kernel_at_rest(self) -> Callable[..., FrictionTerms]:
        """`static`."""
        return static


def check_static(static: float, kinetic: float) -> None:
    """Refuse static friction that is below the kinetic one: mostly the two are exchanged."""
    if static < kinetic:
        found = f'"static" {static:g} is below "kinetic" {kinetic:g}'
        valid = "static friction is at least as large as kinetic friction"
        raise mistake("bad-friction", found, valid, "swap them")
