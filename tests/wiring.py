"""Mechanisms wired in Python for the tests, and the recorded numbers that go with them."""

from __future__ import annotations

import json
import random
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import blockmech as bm
from blockmech import Graph
from blockmech.blocks.contract import Block, Moving
from blockmech.friction.continuation import course_from_zero, end_of
from blockmech.ground.values import Marker, Vector
from blockmech.testing.strategies import Case
from tests.gallery import GRAPHS

DATA = Path(__file__).resolve().parent / "data"
COEFFICIENT, PIN = 0.4, 0.0075  # [-], [m] friction and pin radius of the Ruiz four-bar

EPS = float(np.finfo(np.float64).eps)
"""Distance of 1 to the next double; half of it is the worst rounding of one operation."""


@cache
def recorded(name: str) -> Any:
    """Reference numbers of a mechanism, made outside the project; each file says how."""
    return json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))


def off(found: Any, wanted: Any, scale: float | None = None) -> float:
    """Largest difference, relative to the largest wanted number or to a scale."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    size = float(np.abs(wanted).max()) if scale is None else scale
    return float(np.abs(found - wanted).max()) / (size or 1.0)


def amplification(run: Any) -> float:
    """By how much groups in a row may multiply rounding: 1 / sqrt(margin) along the supports."""
    structure, margins = run.mechanism.structure, run.quality.margin
    good = np.array([s == "ok" for s in run.quality.status])
    found = {structure.frame: np.ones(run.n)}
    for block in structure.blocks:
        own = np.max([found[s] for s in (structure.frame, *structure.supports(block))], axis=0)
        with np.errstate(all="ignore"):
            found[block] = own / np.sqrt(margins[block]) if block in margins else own
    return max((float(c[good].max(initial=1.0)) for c in found.values()), default=1.0)


def wire(graph: Graph, *wires: str) -> Graph:
    """Connect ``"marker joint"`` pairs."""
    for text in wires:
        graph.connect(*text.split())
    return graph


# -- the papers' mechanisms -------------------------------------------------------------


def ruiz(coefficient: float = COEFFICIENT, radius: float = PIN) -> Graph:
    """The four-bar of Ruiz, Durango & Calle 2010, Table 1; radius 0: no friction."""
    g = Graph.load(GRAPHS / "ruiz_fourbar.json")
    law = bm.Coulomb(coefficient=coefficient, radius=radius) if radius else None
    for name in ("crank", "dyad"):
        friction = dict.fromkeys(g.blocks[name].friction, law) if law else {}
        g.blocks[name] = changed(g.blocks[name], friction=friction)
    return g


def continue_from_zero(k, edges, base, rows):
    """The end of a group's path from zero friction."""
    given = k, edges, base, rows
    return end_of(course_from_zero(True, *given), *given)


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
        places = {name: Marker(at=at) for name, at in markers.items()}
        if not massive:
            return bm.Link(markers=places)
        return bm.Link(mass=mass, inertia=inertia, cm=(length / 2, 0.0), markers=places)

    law = bm.Coulomb(coefficient=0.2, radius=0.02)
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
    g.drive("crank", bm.ConstantRate(rate=rate))
    return g


def toggle(friction: bool = True) -> Graph:
    """A slide drive that works an RRR dyad, with a spring and a useful load."""
    pin = bm.Coulomb(coefficient=0.2, radius=0.02)
    guide = bm.Coulomb(coefficient=0.15, guide_length=0.3)
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
    g.drive("ram", bm.ConstantRate(rate=0.5, start=0.0, end=0.6))
    return g


def squeezer() -> Graph:
    """Andrews' squeezer mechanism: three dyads share a pin."""
    return Graph.load(GRAPHS / "andrews_squeezer.json")


def chain(dyads: int, friction: bool = False) -> Graph:
    """A crank that rocks a long chain of dyads, each driven by the rocker before it."""
    law = bm.Coulomb(coefficient=0.1, radius=0.01)
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
    g.drive("crank", bm.ConstantRate(rate=2.0))
    return g


# -- the same mechanism, seen otherwise -------------------------------------------------


def rewired(graph: Graph, order: random.Random | None = None, **changes: Any) -> Graph:
    """The same blocks and wires in a new graph, shuffled; ``changes`` replace blocks."""
    g = Graph(graph.name, gravity=graph.scene.gravity.z)
    blocks: list[tuple[str, Any]] = [(n, changes.get(n, b)) for n, b in graph.blocks.items()]
    wires = [(w.source, w.target) for w in graph.wires]
    if order is not None:
        order.shuffle(blocks)
        order.shuffle(wires)
    for name, block in blocks:
        g.add(name, block)
    for source, target in wires:
        g.connect(source, target)
    g.scene = graph.scene
    return g


def changed(block: Block, **updates: Any) -> Block:
    """A block with some fields replaced, validated again."""
    fields = {name: getattr(block, name) for name in block.model_fields_set}
    return type(block)(**{**fields, **updates})


def mirrored(graph: Graph) -> Graph:
    """The mirror image in the x axis: local coordinates conjugate, angles negative."""
    turned = {"offset", "beta", "h", "h_i", "h_j", "h1", "h2", "moment", "rest_angle"}

    def mirror(block: Any) -> Block:
        updates = {
            n: -getattr(block, n)
            for n in block.model_fields_set & turned
            if n != "offset" or all(j.rotary for j in block.driven)
        }
        if block.type_name == "dyad.rrr":
            updates["branch"] = -block.branch
        if "force" in block.model_fields_set:
            updates["force"] = block.force.z.conjugate()
        return _seen(block, lambda z: z.conjugate(), lambda m: m, **updates)

    g = rewired(graph, **{n: mirror(b) for n, b in graph.blocks.items()})
    gravity = Vector(graph.scene.gravity.z.conjugate())
    g.scene = graph.scene.model_copy(update={"gravity": gravity})
    return g


def scaled(graph: Graph, length: float, force: float) -> Graph:
    """The same mechanism in other units of length and force; the unit of time stays.

    Powers of two change no digit of any number, only its exponent.
    """
    mass = force / length
    powers = {
        "length": length, "l_i": length, "l_j": length, "l": length,
        "h": length, "h_i": length, "h_j": length, "h1": length, "h2": length,
        "x_S": length, "x_S1": length, "x_S2": length, "free_length": length,
        "stiffness": force / length, "damping": force / length, "moment": force * length,
    }  # fmt: skip

    def scale(block: Any) -> Block:
        updates = {n: getattr(block, n) * powers[n] for n in block.model_fields_set & powers.keys()}
        if isinstance(block, bm.TorsionSpring):  # N m a radian, not N a metre
            turns = block.model_fields_set & {"stiffness", "damping"}
            updates |= {n: getattr(block, n) * force * length for n in turns}
        if "offset" in block.model_fields_set and not block.driven[0].rotary:
            updates["offset"] = block.offset * length
        if "force" in block.model_fields_set:
            updates["force"] = block.force.z * force
        if "friction" in block.model_fields_set:
            updates["friction"] = {j: _scaled_law(f, length) for j, f in block.friction.items()}

        def heavier(link: bm.Link) -> bm.Link:
            return changed(link, mass=link.mass * mass, inertia=link.inertia * mass * length**2)

        return _seen(block, lambda z: z * length, heavier, **updates)

    g = rewired(graph, **{n: scale(b) for n, b in graph.blocks.items()})
    gravity = Vector(graph.scene.gravity.z * length)
    g.scene = graph.scene.model_copy(update={"gravity": gravity})
    return g


def _scaled_law(law: bm.Coulomb, length: float) -> bm.Coulomb:
    sizes = {n: getattr(law, n) for n in ("radius", "guide_length")}
    given = {n: x * length for n, x in sizes.items() if x is not None}
    return bm.Coulomb(coefficient=law.coefficient, **given)


def _seen(block: Any, place: Any, link: Any, **updates: Any) -> Block:
    """A block with every place mapped, and every link."""

    mirror = place(1j).imag < 0

    def marker(m: Marker) -> Marker:
        # A direction keeps its spelling, so that it keeps its digits.
        angle, direction = m.angle, m.dir and m.dir.z
        if mirror and angle is not None:
            angle = -angle
        if mirror and direction is not None:
            direction = direction.conjugate()
        return Marker(at=place(m.at.z), angle=angle, dir=direction)

    if isinstance(block, bm.Frame):
        updates["markers"] = {n: marker(m) for n, m in block.markers.items()}
    if isinstance(block, Moving) and block.links:
        updates["links"] = {
            n: changed(
                link(k),
                cm=place(k.cm.z),
                markers={name: marker(m) for name, m in k.markers.items()},
            )
            for n, k in block.links.items()
        }
    return changed(block, **updates)


def swept(case: Case, samples: int, seed: int = 0) -> dict[str, Any]:
    """A random case's request over random driver coordinates, some of them out of reach."""
    rng = np.random.default_rng(seed)
    at = {}
    for driver, home in case.request["at"].items():
        at[driver] = home + np.append(0.0, rng.uniform(-3.0, 3.0, samples - 1))
    return {**case.request, "at": at, "on_gap": "mark"}


def same_bits(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Outputs whose arrays differ in any bit but for the sort of NaN."""
    return [k for k in one if not np.array_equal(one[k], other[k], equal_nan=True)]
