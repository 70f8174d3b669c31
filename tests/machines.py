"""Machines that tests share, by their lengths: blocks, joints and markers have the same names.

Each is a graph that is not compiled yet. Lengths are in m, angles in rad; what a test does not
name (bodies, friction, gravity, loads, drives) is not there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import blockmech as bm
from blockmech import Graph
from blockmech.ground.values import Marker
from tests.gallery import GRAPHS
from tests.wiring import changed

G = 9.81  # [m/s2]
COEFFICIENT, PIN = 0.4, 0.0075  # [-], [m] friction and pin radius of the Ruiz four-bar
Bodies = Sequence[bm.Link | None]
Frictions = Mapping[str, Any] | Any  # joint -> law, or one law for every joint


def bar(mass: float, length: float) -> bm.Link:
    """A uniform slender bar from its joint at the origin to [length, 0]."""
    return bm.Link(mass=mass, inertia=mass * length**2 / 12, cm=(length / 2, 0.0))


def wire(graph: Graph, *wires: str) -> Graph:
    """Connect ports, ``"crank.B dyad.B"`` each; the graph."""
    for ends in wires:
        graph.connect(*ends.split())
    return graph


def load(graph: Graph, name: str, block: Any, **terminals: str) -> Graph:
    """Add a block, its ports connected by their names; the graph."""
    graph.add(name, block)
    for port, source in terminals.items():
        graph.connect(source, f"{name}.{port}")
    return graph


def _links(names: str, bodies: Bodies) -> dict[str, bm.Link]:
    return {name: body for name, body in zip(names, bodies, strict=False) if body is not None}


def _laws(joints: str, friction: Frictions) -> dict[str, Any]:
    if isinstance(friction, Mapping) and "law" not in friction:
        return {joint: friction[joint] for joint in joints if joint in friction}
    return {} if friction is None else dict.fromkeys(joints, friction)


def _frame(name: str, gravity: float, **markers: Any) -> Graph:
    graph = Graph(name, gravity=(0.0, -gravity))
    graph.add("frame", bm.Frame(markers=markers))
    return graph


def _crank(
    graph: Graph,
    name: str,
    pivot: str,
    length: float,
    body: bm.Link | None = None,
    friction: Frictions = None,
) -> None:
    links = {} if body is None else {"crank": body}
    graph.add(name, bm.Crank(length=length, links=links, friction=_laws("A", friction)))
    graph.connect(pivot, f"{name}.A")


def crank(
    length: float = 1.0,
    body: bm.Link | None = None,
    friction: Frictions = None,
    *,
    gravity: float = 0.0,
    name: str = "crank",
    **markers: Any,
) -> Graph:
    """One link on the frame's pivot A: a wheel, an arm or a pendulum that hangs at -pi/2."""
    graph = _frame(name, gravity, A=(0.0, 0.0), **markers)
    _crank(graph, name, "frame.A", length, body, friction)
    return graph


def arms(
    lengths: Mapping[str, float],
    bodies: Bodies = (),
    frictions: Sequence[Frictions] = (),
    *,
    gravity: float = G,
) -> Graph:
    """Links in a row by their names and lengths, each a driver; the first turns about A."""
    graph = _frame("arms", gravity, A=(0.0, 0.0))
    pivot = "frame.A"
    for i, (name, length) in enumerate(lengths.items()):
        body = bodies[i] if bodies else bar(1.0, length)
        _crank(graph, name, pivot, length, body, frictions[i] if frictions else None)
        pivot = f"{name}.B"
    return graph


def fourbar(
    crank: float,
    coupler: float,
    rocker: float,
    ground: complex,
    bodies: Bodies = (),
    friction: Frictions = None,
    *,
    gravity: float = 0.0,
    name: str = "fourbar",
    markers: Mapping[str, Any] | None = None,
    **dyad: Any,
) -> Graph:
    """Crank about A at the origin, dyad RRR between its end B and the pivot D at ``ground``.

    bodies : of crank, coupler and rocker
    dyad : branch and home; branch 1 where it is not named
    """
    graph = _frame(name, gravity, A=(0.0, 0.0), D=complex(ground), **(markers or {}))
    _crank(graph, "crank", "frame.A", crank, *bodies[:1], friction=friction)
    links, laws = _links("ij", bodies[1:]), _laws("BCD", friction)
    dyad = {"branch": 1, **dyad}
    graph.add("dyad", bm.RRR(l_i=coupler, l_j=rocker, links=links, friction=laws, **dyad))
    return wire(graph, "crank.B dyad.B", "frame.D dyad.D")


def slider_crank(
    crank: float,
    rod: float,
    offset: float = 0.0,
    bodies: Bodies = (),
    friction: Frictions = None,
    *,
    gravity: float = 0.0,
    **dyad: Any,
) -> Graph:
    """Crank about A, dyad RRP whose slider runs along x at y = ``offset``; its pin is C.

    bodies : of crank, rod and slider
    """
    guide = bm.Marker(at=(0.0, offset), angle=0.0)
    graph = _frame("slider_crank", gravity, A=(0.0, 0.0), G=guide)
    _crank(graph, "crank", "frame.A", crank, *bodies[:1], friction=friction)
    links, laws = _links("ij", bodies[1:]), _laws("BCS", friction)
    graph.add("dyad", bm.RRP(l=rod, links=links, friction=laws, **dyad))
    return wire(graph, "crank.B dyad.B", "frame.G dyad.S")


def fivebar(
    crank: float,
    rod: float,
    apart: float,
    bodies: Bodies = (),
    frictions: Mapping[str, Frictions] | None = None,
    *,
    gravity: float = 0.0,
) -> Graph:
    """Cranks ``left`` and ``right`` about A and D, and a dyad RRR between their ends.

    bodies : of the left crank, the right one, and both rods
    frictions : block -> friction of its joints
    """
    frictions = frictions or {}
    graph = _frame("fivebar", gravity, A=(0.0, 0.0), D=(apart, 0.0))
    for name, pivot, body in zip(("left", "right"), "AD", bodies[:2] or (None, None), strict=True):
        _crank(graph, name, f"frame.{pivot}", crank, body, frictions.get(name))
    links, laws = _links("ij", bodies[2:]), _laws("BCD", frictions.get("dyad"))
    graph.add("dyad", bm.RRR(l_i=rod, l_j=rod, branch=1, links=links, friction=laws))
    return wire(graph, "left.B dyad.B", "right.B dyad.D")


def pushed(
    coupler: float,
    rocker: float,
    pivot: complex,
    bodies: Bodies = (),
    *,
    gravity: float = 0.0,
    **dyad: Any,
) -> Graph:
    """A slide drive ``ram`` along x that pushes a dyad RRR on the pivot D.

    bodies : of coupler and rocker
    """
    guide = bm.Marker(at=(0.0, 0.0), angle=0.0)
    graph = _frame("pushed", gravity, G=guide, D=complex(pivot))
    graph.add("ram", bm.SlideDrive())
    graph.add("dyad", bm.RRR(l_i=coupler, l_j=rocker, links=_links("ij", bodies), **dyad))
    return wire(graph, "frame.G ram.S", "ram.S dyad.B", "frame.D dyad.D")


def pulled(body: bm.Link, friction: Any, laws: Mapping[str, Any], *, gravity: float = 0.0) -> Graph:
    """A slider ``block`` on a floor along x, and thrusts by polynomials from a post at x = -1."""
    floor = bm.Marker(at=(0.0, 0.0), angle=0.0)
    graph = _frame("block", gravity, A=floor, W=(-1.0, 0.0))
    friction = _laws("S", friction)
    graph.add("block", bm.SlideDrive(links={"slider": body}, friction=friction))
    graph.connect("frame.A", "block.S")
    for name, law in laws.items():
        law = {"kind": "polynomial", **law}
        load(graph, name, bm.Thrust(law=law), a="frame.W", b="block.slider")
    return graph


def ruiz(coefficient: float = COEFFICIENT, radius: float = PIN) -> Graph:
    """The four-bar of Ruiz, Durango & Calle 2010, Table 1; radius 0: no friction."""
    g = Graph.load(GRAPHS / "ruiz_fourbar.json")
    law = bm.friction.Coulomb(coefficient=coefficient, radius=radius) if radius else None
    for name in ("crank", "dyad"):
        friction = dict.fromkeys(g.blocks[name].friction, law) if law else {}
        g.blocks[name] = changed(g.blocks[name], friction=friction)
    return g


def watt(
    *,
    massive: bool = True,
    gravity: bool = True,
    force: bool = False,
    spring: float | None = None,
    friction: bool = False,
    rate: float = 1.0,
) -> Graph:
    """The Watt six-bar of Durango et al. 2014, Table 1; links 2, 3, 4, 5, 6 as there.

    ``force`` is a static one on link 3, ``spring`` joins links 3 and 6 with that damping.
    """

    def rod(mass: float, length: float, inertia: float, **markers: complex) -> bm.Link:
        points = {name: Marker(at=at) for name, at in markers.items()}
        if not massive:
            return bm.Link(markers=points)
        return bm.Link(mass=mass, inertia=inertia, cm=(length / 2, 0.0), markers=points)

    law = bm.friction.Coulomb(coefficient=0.2, radius=0.02)
    g = Graph("watt_sixbar", gravity=(0.0, -9.81) if gravity else (0.0, 0.0))
    g.add("frame", bm.Frame(markers={"O2": (0.0, 0.0), "O4": (1.6, 0.0)}))
    links = {"crank": rod(1.0, 1.0, 0.0833)}
    g.add("crank", bm.Crank(length=1.0, links=links, friction={"A": law} if friction else {}))
    pins = dict.fromkeys("BCD", law) if friction else {}
    links = {
        "i": rod(1.5, 1.5, 0.2813, E=0.75 + 0j, K=0.5 + 0.2j),
        "j": rod(1.5, 1.5, 0.2813, E4=0.75 + 0j),
    }
    g.add("first", bm.RRR(l_i=1.5, l_j=1.5, branch=1, links=links, friction=pins))
    links = {"i": rod(1.0, 1.0, 0.0833), "j": rod(1.0, 1.0, 0.0833, K6=0.4 - 0.1j)}
    g.add("last", bm.RRR(l_i=1.0, l_j=1.0, branch=1, links=links, friction=pins))
    wire(
        g,
        "frame.O2 crank.A",
        "crank.B first.B",
        "frame.O4 first.D",
        "first.E last.B",
        "first.E4 last.D",
    )
    if force:
        g.add("push", bm.Force(force=(30.0, -40.0)))
        g.connect("first.K", "push.at")
    if spring is not None:
        g.add("spring", bm.Spring(stiffness=80.0, free_length=0.2, damping=spring))
        wire(g, "first.K spring.a", "last.K6 spring.b")
    g.drive("crank", bm.motion.ConstantRate(rate=rate))
    return g


def toggle(friction: bool = True) -> Graph:
    """A slide drive that works an RRR dyad, with a spring and a useful load."""
    pin = bm.friction.Coulomb(coefficient=0.2, radius=0.02)
    guide = bm.friction.Coulomb(coefficient=0.15, guide_length=0.3)
    g = Graph("toggle", gravity=(0.0, -9.81))
    markers = {
        "G": Marker(at=(-0.4, 0.3), angle=0.2),
        "D": Marker(at=(1.2, -0.2)),
        "K": Marker(at=(0.2, 1.4)),
    }
    g.add("frame", bm.Frame(markers=markers))
    slider = bm.Link(mass=2.0, inertia=0.1, cm=(0.05, 0.02), markers={"B": (0.1, 0.1)})
    ram = bm.SlideDrive(offset=0.1, links={"slider": slider}, friction={"S": guide})
    g.add("ram", ram if friction else bm.SlideDrive(offset=0.1, links={"slider": slider}))
    links = {
        "i": bm.Link(mass=1.5, inertia=0.2, cm=(0.5, 0.1), markers={"P": (0.6, -0.2)}),
        "j": bm.Link(mass=1.0, inertia=0.15, cm=(0.4, 0.0), markers={"W": (0.5, 0.1)}),
    }
    pins = dict.fromkeys("BCD", pin) if friction else {}
    g.add("dyad", bm.RRR(l_i=1.1, l_j=0.9, branch=1, links=links, friction=pins))
    g.add("spring", bm.Spring(stiffness=200.0, free_length=0.5, damping=4.0))
    g.add("work", bm.Force(force=(-60.0, -80.0), useful=True))
    wire(
        g,
        "frame.G ram.S",
        "ram.B dyad.B",
        "frame.D dyad.D",
        "dyad.P spring.a",
        "frame.K spring.b",
        "dyad.W work.at",
    )
    g.drive("ram", bm.motion.ConstantRate(rate=0.5, start=0.0, end=0.6))
    return g


def squeezer() -> Graph:
    """Andrews' squeezer mechanism: three dyads share a pin."""
    return Graph.load(GRAPHS / "andrews_squeezer.json")


def chain(dyads: int, friction: bool = False) -> Graph:
    """A crank that rocks a long chain of dyads, each driven by the rocker before it."""
    law = bm.friction.Coulomb(coefficient=0.1, radius=0.01)
    pins = dict.fromkeys("BCD", law) if friction else {}
    pivots = {f"D{k}": (3.0 * (k + 1), 0.1 * (k % 3)) for k in range(dyads)}
    g = Graph("chain", gravity=(0.0, -9.81))
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.0), **pivots}))
    g.add("crank", bm.Crank(length=0.5))
    g.connect("frame.A", "crank.A")
    links = {
        "i": bm.Link(mass=1.0, inertia=0.1, cm=(0.5, 0.1)),
        "j": bm.Link(mass=1.0, inertia=0.1, cm=(0.5, 0.1), markers={"E": (0.5, 0.0)}),
    }
    source = "crank.B"
    for k in range(dyads):
        name = f"dyad{k:05d}"
        g.add(name, bm.RRR(l_i=3.0, l_j=1.0, links=links, friction=pins))
        wire(g, f"{source} {name}.B", f"frame.D{k} {name}.D")
        source = f"{name}.E"
    g.drive("crank", bm.motion.ConstantRate(rate=2.0))
    return g
