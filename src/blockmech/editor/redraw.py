"""A diagram of blocks as links and joints, so that it can be drawn on.

Links stand where they are in the pose that is farthest from all dead centres, which fixes the
assembly modes. The document that is made is run and compared with the blocks: what links and
joints do not say alike is refused.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from blockmech.builders import Linkage
from blockmech.draw.motion import Motion
from blockmech.ground.errors import BlockmechError, RequestError, refused
from blockmech.ground.tolerances import EQUAL
from blockmech.model.joints.blocks import Form, SaidByLinks
from blockmech.model.joints.contents import FRAME
from blockmech.typing import Record

COMPARED = 3  # poses


def as_links(form: Record, motion: Motion) -> Form:
    """A graph's form as links and joints.

    Raises `RequestError` where these do not say the same, with the reason.
    """
    k, axis = motion.clearest, motion.axis
    poses = {link: (complex(o[k]), complex(axis[link][k])) for link, o in motion.origin.items()}
    drivers = motion.structure.driven
    coordinates = motion.result._inside(*(f"{driver}.q" for driver in drivers))
    at = {driver: float(coordinates[f"{driver}.q"][motion.samples[k]]) for driver in drivers}
    redrawn = SaidByLinks(form, motion.structure, poses, at)
    form_of_links = redrawn.document()
    try:
        linkage = Linkage.from_data(form_of_links)
        if problems := linkage.check():
            raise RequestError(*problems)
        _compare(redrawn, motion, linkage.compile())
    except BlockmechError as error:
        why = f"links and joints do not say the same: {error}"
        raise refused("blocks", why, "draw the mechanism anew") from None
    data: Form = linkage.to_data()
    return data


def _compare(redrawn: SaidByLinks, motion: Motion, mechanism: Any) -> None:
    """Raises `RequestError` where a link of the other mechanism stands elsewhere."""
    rows = np.flatnonzero(motion.feasible)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, COMPARED).astype(int))]
    at = {redrawn.drivers[d]: q[rows] for d, q in motion.q.items()}
    want = [f"link.{name}.p" for name in redrawn.links.values() if name != FRAME]
    result = mechanism.run(at=at, rates=dict.fromkeys(at, 0.0), want=want, friction="none")
    size = max(float(np.nanmax(np.abs(z))) for z in motion.origin.values()) or 1.0
    for link, name in redrawn.links.items():
        if name != FRAME:
            off = np.abs(result[f"link.{name}.p"] - motion.origin[link][rows]).max()
            if not off <= EQUAL * size:
                where = f"{name} would stand {off:.3g} m elsewhere"
                raise refused(name, where, "look at the coordinates of the drivers")
