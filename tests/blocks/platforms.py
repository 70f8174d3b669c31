"""Platforms on three legs, a general group each: massive, rough and loaded."""

from __future__ import annotations

import cmath
from functools import cache

import blockmech as bm
from tests import machines
from tests.blocks.machines import LONG_SHOE, PIN, body

ROOTS = {"L1": (5.5, 1.5), "L2": (-1.0, 4.0)}  # [m] of the legs on the frame
PINS = (1.2 + 2.2j, 3.2 + 2.4j, 2.0 + 3.4j)  # [m] of the platform at home
HOME = 0.6  # [rad] of the crank
REACH = 1.1  # [m] of the piston in the first leg at home


def platform(crank=0.6, cylinder=False, names=str, scale=1.0, shift=0j, gravity=(0.4, -9.81)):
    """A platform on two legs from the frame and one from a crank; its first leg may be driven.

    ``names`` renames links and pairs, ``scale`` and ``shift`` enlarge and move everything.
    """

    def place(z):
        z = complex(z) * scale
        return (z.real, z.imag)

    foot = crank * cmath.exp(1j * HOME)
    feet = [foot, *(complex(*root) for root in ROOTS.values())]
    o, e = PINS[0], PINS[1] - PINS[0]
    e /= abs(e)
    links, pairs, poses, wires = {}, {}, {}, []

    def link(name, at, angle, **more):
        links[names(name)] = more["body"]
        poses[names(name)] = (*place(at + shift), angle)

    for k, (start, end) in enumerate(zip(feet, PINS, strict=True)):
        angle, length = cmath.phase(end - start), abs(end - start)
        properties = body(1.0 + k, 0.1 * scale**2, place(0.4 * length + 0.05j))
        leg = f"leg {k}"
        link(leg, start, angle, body=properties)
        pairs[names(f"G{k}")] = {"type": "R", "link": names(leg)}
        outer, at = leg, length
        if k == 0 and cylinder:
            outer, at = "piston", 0.0
            link(outer, end, angle, body=body(0.7, 0.05 * scale**2, place(-0.3 + 0.02j)))
            pairs[names("S")] = {
                "type": "P",
                "links": (names(leg), names(outer)),
                "at": (place(length - REACH), (0.0, 0.0)),
                "driven": True,
            }
        pairs[names(f"C{k}")] = {
            "type": "R",
            "links": (names(outer), names("plate")),
            "at": (place(at), place((end - o) / e)),
        }
        wires.append(("crank.B" if k == 0 else f"frame.L{k}", f"platform.{names(f'G{k}')}"))
    tool = {"tool": place(0.8 + 0.6j)}
    plate = body(3.0, 1.0 * scale**2, place(0.8 + 0.3j), **tool)
    link("plate", o, cmath.phase(e), body=plate)
    home = {"drivers": {"crank": HOME}, "poses": poses}
    if cylinder:
        home["drivers"][f"platform.{names('S')}"] = REACH * scale
    laws = {n: LONG_SHOE if pair["type"] == "P" else PIN for n, pair in pairs.items()}
    graph = bm.Graph("platform", gravity=gravity)
    roots = {"O": place(shift), **{n: place(complex(*z) + shift) for n, z in ROOTS.items()}}
    graph.add("frame", bm.Frame(markers=roots))
    arm = body(1.0, 0.02 * scale**2, place(0.3 * crank))
    graph.add("crank", bm.Crank(length=crank * scale, links={"crank": arm}, friction={"A": PIN}))
    graph.add("platform", bm.GeneralGroup(links=links, pairs=pairs, home=home, friction=laws))
    graph.add("load", bm.Force(force=(40.0, -70.0)))
    graph.connect("frame.O", "crank.A")
    for wire in wires:
        graph.connect(*wire)
    graph.connect("platform.tool", "load.at")
    return graph


def triad():
    """A Stephenson six-bar linkage: the platform is a triad."""
    return platform()


def two_drivers():
    """The same with a driven length in the leg that stands on the crank."""
    return platform(cylinder=True)


@cache
def triad_and_arc():
    """The triad compiled, and the arc of its crank about home."""
    mech = triad().compile()
    return mech, mech.limits().arc_at(HOME)


triad.home = {"crank": HOME}
triad.span = {"crank": 3.0}
two_drivers.home = {"crank": HOME, "platform.S": REACH}
two_drivers.span = {"crank": 1.5, "platform.S": 0.3}


def stacked():
    """A second general group stands on the first one's plate and on the crank."""
    graph = platform(crank=0.4)
    group = graph.blocks["platform"]
    plate = group.links["plate"]
    more = {
        **plate.markers,
        "seat": bm.Marker(at=(0.2, 0.9)),
        "rail": bm.Marker(at=(1.4, 0.2), angle=0.7),
    }
    links = {**group.links, "plate": plate.model_copy(update={"markers": more})}
    graph.blocks["platform"] = group.model_copy(update={"links": links})
    start = {"drivers": {"crank": HOME}, "poses": {}}
    at = (
        platform(crank=0.4)
        .compile()
        .run(at=HOME, want=["platform.plate.p", "platform.plate.angle"])
    )
    o = at["platform.plate.p"][0]
    e = cmath.exp(1j * at["platform.plate.angle"][0])
    seat, rail = o + e * (0.2 + 0.9j), o + e * (1.4 + 0.2j)
    knee = seat + 0.9 * cmath.exp(0.8j)
    shoe = rail + 0.5 * e * cmath.exp(0.7j)
    start["poses"]["arm"] = (seat.real, seat.imag, cmath.phase(knee - seat))
    start["poses"]["shoe"] = (shoe.real, shoe.imag, cmath.phase(e) + 0.7)
    pin = (knee - shoe) / (e * cmath.exp(0.7j))
    pairs = {
        "A": {"type": "R", "link": "arm"},
        "B": {"type": "R", "links": ("arm", "shoe"), "at": ((0.9, 0.0), (pin.real, pin.imag))},
        "S": {"type": "P", "link": "shoe", "slider": "earlier"},
    }
    bodies = {"arm": body(0.5, 0.02, (0.4, 0.05)), "shoe": body(0.8, 0.03, (0.1, -0.05))}
    laws = {"A": PIN, "B": PIN, "S": LONG_SHOE}
    graph.add("rider", bm.GeneralGroup(links=bodies, pairs=pairs, home=start, friction=laws))
    return machines.wire(graph, "platform.seat rider.A", "platform.rail rider.S")
