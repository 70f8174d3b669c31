"""Recorded numbers, and the same machine said otherwise: rewired, mirrored, in other units."""

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
from blockmech.friction.equations import Equations
from blockmech.ground.values import Marker, Vector
from blockmech.testing.strategies import Case

DATA = Path(__file__).resolve().parent / "data"

EPS = float(np.finfo(np.float64).eps)
"""Distance of 1 to the next double; half of it is the worst rounding of one operation."""


@cache
def recorded(name: str) -> Any:
    """Reference numbers of a mechanism, made outside the project; each file says how."""
    return json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))


def off(values: Any, expected: Any, scale: float | None = None) -> float:
    """Largest difference, relative to the largest wanted number or to a scale."""
    values, expected = np.asarray(values), np.asarray(expected)
    size = float(np.abs(expected).max()) if scale is None else scale
    return float(np.abs(values - expected).max()) / (size or 1.0)


def amplification(run: Any) -> float:
    """By how much groups in a row may multiply rounding: 1 / sqrt(margin) along the supports."""
    structure, margins = run.mechanism.structure, run.quality.margin
    good = np.array([s == "ok" for s in run.quality.status])
    result = {structure.frame: np.ones(run.n)}
    for block in structure.blocks:
        largest = np.max([result[s] for s in (structure.frame, *structure.supports(block))], axis=0)
        with np.errstate(all="ignore"):
            result[block] = largest / np.sqrt(margins[block]) if block in margins else largest
    return max((float(c[good].max(initial=1.0)) for c in result.values()), default=1.0)


def continue_from_zero(k, edges, base, rows):
    """The end of a group's path from zero friction."""
    of = Equations(k, edges, base, rows)
    return end_of(course_from_zero(True, of), of)


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


def _scaled_law(law: bm.friction.Coulomb, length: float) -> bm.friction.Coulomb:
    sizes = {n: getattr(law, n) for n in ("radius", "guide_length")}
    lengths = {n: x * length for n, x in sizes.items() if x is not None}
    return bm.friction.Coulomb(coefficient=law.coefficient, **lengths)


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


def same_bits(first: Mapping[str, Any], second: Mapping[str, Any]) -> list[str]:
    """Outputs whose arrays differ in any bit but for the sort of NaN."""
    return [k for k in first if not np.array_equal(first[k], second[k], equal_nan=True)]
