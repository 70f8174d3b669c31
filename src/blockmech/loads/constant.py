"""Constant loads: a force at a marker, a couple on a link.

Sources: [R10] Ruiz, Durango & Calle 2010, Fig. 5 (external forces F_i, F_j, moments M_i, M_j).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

from blockmech.ground.plane import always
from blockmech.ground.values import Number, VectorGiven, in_unit
from blockmech.loads.contract import Element, Terminal
from blockmech.typing import Complex, Real


def ground_force(p: Force) -> tuple[Complex]:
    """The force [N] as given, in ground axes."""
    return (p.force,)


def link_force(e_at: Complex, p: Force) -> tuple[Complex]:
    """The force [N] turned with the link, e_at its unit x axis."""
    return (e_at * p.force,)


class Force(Element, type="load.force"):
    """A constant force [N] at marker ``at``, in ground axes or turning with the link.

    >>> Force(force=(0.0, -1000.0)).axes
    'ground'
    """

    terminals = {"at": Terminal("point")}

    force: Annotated[VectorGiven, in_unit("N")]
    axes: Literal["ground", "link"] = "ground"

    @property
    def conservative(self) -> bool:
        """In ground axes it is as a weight."""
        return self.axes == "ground"

    def kernel(self) -> Callable[..., Any]:
        """The force in the axes that the user chose."""
        return link_force if self.axes == "link" else ground_force


def couple(p: Couple) -> tuple[Real]:
    """The moment [N m] as given."""
    return (p.moment,)


class Couple(Element, type="load.couple"):
    """A constant moment [N m] on the link ``on``, counter-clockwise positive.

    >>> Couple(moment=-250.0).moment
    -250.0
    """

    terminals = {"on": Terminal("link")}

    moment: Annotated[Number, in_unit("N m")]

    kernel = always(couple)
