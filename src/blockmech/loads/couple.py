"""A constant couple on a link.

Sources: [R10] Ruiz, Durango & Calle 2010, Fig. 5 (external moments M_i, M_j).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from blockmech.loads.contract import Element, Terminal
from blockmech.typing import Real
from blockmech.values import Number, in_unit


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

    def kernel(self) -> Callable[..., Any]:
        """The constant moment."""
        return couple
