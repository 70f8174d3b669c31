"""Theo Jansen's walking leg: how far it steps, how high, and a page on which it walks."""

import math
import sys
from pathlib import Path

import blockmech as bm
from blockmech.draw import animate


def corner(near: float, far: float, base: float) -> complex:
    """The third corner of a triangle above its base, which lies on x from the origin."""
    x = (near**2 - far**2 + base**2) / (2 * base)
    return complex(x, math.sqrt(near**2 - x**2))


# The links are as long as Jansen's "holy numbers", in centimetres.
hip, foot = bm.Marker(at=corner(0.401, 0.558, 0.415)), bm.Marker(at=corner(0.490, 0.657, 0.367))
g = bm.Graph("walking_leg", drive={"crank": bm.motion.ConstantRate(rate=-2.0)})
g.add("frame", bm.Frame(markers={"O": (0.0, 0.0), "P": (-0.380, -0.078)}))
g.add("crank", bm.Crank(length=0.150))
g.add("upper", bm.RRR(l_i=0.500, l_j=0.415, branch=-1, links={"j": bm.Link(markers={"hip": hip})}))
g.add("lower", bm.RRR(l_i=0.619, l_j=0.393, branch=1))
g.add("leg", bm.RRR(l_i=0.394, l_j=0.367, branch=-1, links={"j": bm.Link(markers={"foot": foot})}))
for wire in (
    "frame.O crank.A", "crank.B upper.B", "frame.P upper.D", "crank.B lower.B", "frame.P lower.D",
    "upper.hip leg.B", "lower.C leg.D",
):  # fmt: skip
    g.connect(*wire.split())

leg = g.compile()
for name, part in (("step", "x"), ("lift", "y")):
    way = leg.extremes("leg.foot.p")[part]
    print(f"{name}: {way.maximum.value - way.minimum.value:.3f} m")
page = Path(sys.argv[1] if len(sys.argv) > 1 else "walking_leg.html")
animate(leg, page, trace=["leg.foot"], frames=36)
print(f"{page} walks")
