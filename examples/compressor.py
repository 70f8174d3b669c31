"""Compressor on an electric motor, 1 to 5 bar: how large a flywheel keeps its run even?"""

import math

import numpy as np

import blockmech as bm

R, L, AREA, DEAD = 0.05, 0.2, math.pi * 0.05**2, 0.006  # [m], [m2]; DEAD: left above the piston
HEAD = R + L + DEAD  # [m] from the crank's pin; the crank is at 0 nearest the head


def gas(angle: np.ndarray) -> np.ndarray:
    """Force [N] on the piston over the crank's angle: polytropes of exponent 1.3, ideal valves."""
    gap = HEAD - R * np.cos(angle) - np.sqrt(L**2 - (R * np.sin(angle)) ** 2)
    start, p = np.where(angle < math.pi, DEAD, DEAD + 2 * R), np.where(angle < math.pi, 5e5, 1e5)
    return AREA * (np.clip(p * (start / gap) ** 1.3, 1e5, 5e5) - 1e5)


def compressor(flywheel: float) -> bm.Graph:
    """The machine with a flywheel [kg m2]."""
    angles = np.arange(0.0, 2 * math.pi, math.pi / 18)
    g, guide = bm.Graph("compressor"), bm.Marker(at=(0.0, 0.0), angle=0.0)
    g.add("frame", bm.Frame(markers={"O": (0.0, 0.0), "G": guide, "head": (HEAD, 0.0)}))
    g.add("crank", bm.Crank(length=R, links={"crank": bm.Link(mass=5.0, inertia=flywheel)}))
    g.add("rod", bm.RRP(l=L, h=0.0, branch=1, links={"j": bm.Link(mass=1.2, inertia=0.01)}))
    law = bm.laws.Table(arguments=angles, values=gas(angles), of="coordinate", turns=1)
    g.add("gas", bm.Thrust(law=law, driver="crank"))  # pushes the piston away from the head
    g.add("motor", bm.Motor(law=bm.laws.DC(stall_moment=200.0, no_load_speed=105.0)))
    wires = "frame.O crank.A, crank.B rod.B, frame.G rod.S, frame.head gas.a, rod.j gas.b"
    for wire in f"{wires}, frame.O motor.a, crank.crank motor.b".split(", "):
        g.connect(*wire.split())
    g.start("crank", q=0.0, rate=100.0)
    return g


for inertia in (0.1, 0.2):  # [kg m2]
    w = compressor(inertia).compile().simulate("steady", want="crank.rate")["crank.rate"]
    print(f"{inertia} kg m2: {w.mean():.1f} rad/s, uneven by {np.ptp(w) / w.mean():.1%}")
