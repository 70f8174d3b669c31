"""The four-bar of Ruiz, Durango & Calle 2010 (Table 1), wired in ten lines.

Prints the driving moment with joint friction at crank 0, 1, ..., 6 rad.
"""

import cmath
import math

import blockmech as bm

PIN = bm.friction.Coulomb(coefficient=0.4, radius=0.0075)
PINS = dict.fromkeys("BCD", PIN)
S = cmath.rect(2.5, math.pi / 6)  # corner of the coupler, a plate B-C-S
CRANK = {"crank": bm.Link(mass=4.8, inertia=1.7, cm=(1.0, 0.0))}
PLATE = bm.Link(mass=30.0, inertia=48.8, cm=cmath.rect(2.8, 0.152), markers={"S": S})
ROCKER = bm.Link(mass=7.2, inertia=5.5, cm=(1.5, 0.0))


def fourbar() -> bm.Graph:
    """Crank AB, plate BCS with a load at S, rocker DC with a couple; friction in all pins."""
    g = bm.Graph("ruiz_fourbar", drive={"crank": bm.motion.ConstantRate(rate=10.0)})
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), "D": (5.5, 0.0)}))
    g.add("crank", bm.Crank(length=2.0, links=CRANK, friction={"A": PIN}))
    g.add("dyad", bm.RRR(l_i=6.0, l_j=3.0, links={"i": PLATE, "j": ROCKER}, friction=PINS))
    g.add("weightlike", bm.Force(force=(0.0, -1000.0)))
    g.add("couple", bm.Couple(moment=-250.0))
    g.connect("frame.A", "crank.A")
    g.connect("crank.B", "dyad.B")
    g.connect("frame.D", "dyad.D")
    g.connect("dyad.S", "weightlike.at")
    g.connect("dyad.j", "couple.on")
    return g


if __name__ == "__main__":
    print(fourbar())
    print(fourbar().run(at=range(7), want="crank.drive"))
