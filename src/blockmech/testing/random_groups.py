"""Random groups: from the places of their ends to parameters and places of their links.

A placer ``(chance, min_margin, end, end)`` gets the place and direction of what its outer
joints are wired to, and gives the block's parameters, the pose of its links and the
coordinates of its driven joints, or None where the ends leave no good one. A general group
has a shape first, drawn until it is determinate, and then as many ends as that has.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from random import Random
from typing import NamedTuple

from blockmech.assur.groups import Pair
from blockmech.assur.rigidity import rigidity
from blockmech.blocks.general import GeneralGroup
from blockmech.blocks.general.equations import ends
from blockmech.blocks.general.kernels import jacobian
from blockmech.ground.plane import cross, dot, spread
from blockmech.ground.values import Link
from blockmech.typing import Data, Guide, LinkPosition

Spot = tuple[complex, complex]


class Placed(NamedTuple):
    """Parameters, place and direction of each link, coordinate [rad or m] of driven joints."""

    numbers: Data
    poses: dict[str, Spot]
    drives: Mapping[str, float] = {}


OWNERS = ("later", "later", "earlier")  # of a slider's point


def _sliders(chance: Random, *joints: str) -> Data:
    """Where the points of sliders lie on their guides, and which link has them."""
    numbers: Data = {f"x_{joint}": chance.uniform(-0.3, 0.3) for joint in joints}
    owners = {joint: chance.choice(OWNERS) for joint in joints}
    return numbers | {"slider": owners if len(joints) > 1 else owners[joints[0]]}


def _crank(chance: Random, min_margin: float, A: Spot) -> Placed:
    (p, u), q = A, chance.uniform(-math.pi, math.pi)
    pose = (p, u * cmath.rect(1.0, q))
    return Placed({"length": chance.uniform(0.3, 1.5)}, {"crank": pose}, {"A": q})


def _slide(chance: Random, min_margin: float, S: Spot) -> Placed:
    (p, u), q = S, chance.uniform(0.2, 1.5) * chance.choice((-1, 1))
    return Placed({}, {"slider": (p + q * u, u)}, {"S": q})


def _rrr(chance: Random, min_margin: float, B: Spot, D: Spot) -> Placed | None:
    b, d = B[0], D[0]
    side = chance.choice((-1, 1))
    c = b + (d - b) * complex(chance.uniform(-0.3, 1.3), side * chance.uniform(0.2, 2.0))
    u, w = c - b, c - d
    if abs(d - b) < 0.1 or _sine2(u, w) < min_margin:
        return None
    numbers = {"l_i": abs(u), "l_j": abs(w), "branch": side}
    return Placed(numbers, {"i": (b, u / abs(u)), "j": (d, w / abs(w))})


def _rrp(chance: Random, min_margin: float, B: Spot, S: Spot) -> Placed | None:
    b, (g, u) = B[0], S
    h, x = chance.uniform(-0.4, 0.4), chance.uniform(-1.5, 1.5)
    c = g + x * u - 1j * u * h
    w = c - b
    component = dot(w, u)
    if abs(w) < 0.1 or (component / abs(w)) ** 2 < min_margin:
        return None
    numbers = {"l": abs(w), "h": h, "branch": 1 if component > 0 else -1} | _sliders(chance, "S")
    return Placed(numbers, {"i": (b, w / abs(w)), "j": (c, u)})


def _rpr(chance: Random, min_margin: float, B: Spot, D: Spot) -> Placed | None:
    b, d = B[0], D[0]
    u = cmath.rect(1.0, chance.uniform(-math.pi, math.pi))
    s, h = dot(d - b, u), cross(u, d - b)
    if abs(d - b) < 0.1 or (s / abs(d - b)) ** 2 < min_margin:
        return None
    h_j = chance.uniform(-0.4, 0.4)
    numbers = {"h_i": h + h_j, "h_j": h_j, "branch": 1 if s > 0 else -1}
    return Placed(numbers | _sliders(chance, "S"), {"i": (b, u), "j": (d, u)})


def _prp(chance: Random, min_margin: float, S1: Spot, S2: Spot) -> Placed | None:
    (g1, u1), (g2, u2) = S1, S2
    if _sine2(u1, u2) < min_margin:
        return None
    h1, h2 = chance.uniform(-0.4, 0.4), chance.uniform(-0.4, 0.4)
    base1, base2 = g1 - 1j * u1 * h1, g2 - 1j * u2 * h2
    x = cross(base2 - base1, u2) / cross(u1, u2)
    c = base1 + x * u1
    if abs(c) > 20:
        return None
    return Placed({"h1": h1, "h2": h2} | _sliders(chance, "S1", "S2"), {"i": (c, u1), "j": (c, u2)})


def _rpp(chance: Random, min_margin: float, B: Spot, S: Spot) -> Placed | None:
    b, (g, u2) = B[0], S
    beta = chance.uniform(0.3, 2.8) * chance.choice((-1, 1))
    if math.sin(beta) ** 2 < min_margin:
        return None
    u1 = u2 * cmath.rect(1.0, beta)
    h_i, h_j = chance.uniform(-0.4, 0.4), chance.uniform(-0.4, 0.4)
    n1 = 1j * u1
    x = (dot(b - g, n1) + h_i - h_j) / cross(u1, u2)
    numbers = {"beta": beta, "h_i": h_i, "h_j": h_j} | _sliders(chance, "S1", "S")
    return Placed(numbers, {"i": (b, u1), "j": (g + x * u2, u2)})


def _cylinder(chance: Random, min_margin: float, B: Spot, D: Spot) -> Placed | None:
    dyad = _rrr(chance, min_margin, B, D)
    if dyad is None:
        return None
    numbers, poses, _ = dyad
    q = numbers.pop("l_i")
    numbers |= _sliders(chance, "S")
    (b, e), j = poses.values()
    return Placed(numbers, {"barrel": (b, e), "rod": (b + q * e, e), "j": j}, {"S": q})


def _sine2(a: complex, b: complex) -> float:
    return float(cross(a, b) / (abs(a) * abs(b))) ** 2


class Tie(NamedTuple):
    """A pair of a general group without geometry; ``first`` is "" for a support."""

    first: str
    second: str
    kind: str
    driven: bool

    @property
    def guided(self) -> bool:
        """Whether an outer pair reads a direction."""
        return self.kind == "P" or self.driven


Shape = Mapping[str, Tie]
"""Pairs of a general group by name."""
SIZES = ((2, 0), (4, 0), (4, 0), (6, 0), (1, 1), (3, 1), (5, 1), (2, 2), (4, 2))
"""Numbers of links and driven pairs: 3 n - k is even."""
SOFT = 0.05  # margins of general groups are ratios of singular values: smaller than a sine


def random_shape(chance: Random, sizes: Sequence[tuple[int, int]] = SIZES) -> Shape:
    """Random links and pairs that are determinate together for generic lengths."""
    n, k = chance.choice(sizes)
    links, count = [f"k{i}" for i in range(n)], (3 * n - k) // 2
    while True:
        shape = {}
        for i in range(count):
            second = links[i] if i < n else chance.choice(links)
            first = chance.choice([*("" for _ in range(max(2, n // 2))), *links])
            if first != second:
                shape[f"J{i}"] = Tie(
                    first, second, chance.choice("RRRP"), i >= (3 * n - k) // 2 - k
                )
        if len(shape) == (3 * n - k) // 2 and is_determinate(links, shape):
            return shape


def is_determinate(links: Sequence[str], shape: Shape) -> bool:
    """Whether nothing moves and nothing is held twice, for generic lengths."""
    pairs = [Pair(n, t.first or " ", t.second, t.kind) for n, t in shape.items()]  # type: ignore[arg-type]
    return rigidity(links, pairs, [" "], [n for n, t in shape.items() if t.driven]).determinate


def random_group(
    chance: Random, min_margin: float, shape: Shape, supports: Mapping[str, Spot]
) -> Placed | None:
    """A general group of this shape on its supports: parameters without the home's drivers."""
    links = dict.fromkeys(x for tie in shape.values() for x in (tie.first, tie.second) if x)
    spots = {
        link: (
            complex(chance.uniform(-2.0, 2.0), chance.uniform(-2.0, 2.0)),
            cmath.rect(1.0, chance.uniform(-math.pi, math.pi)),
        )
        for link in links
    }
    pairs, drives = {}, {}
    for name, tie in shape.items():
        pairs[name], q = _pair(chance, tie, spots, supports.get(name))
        if tie.driven:
            drives[name] = q
    poses = {k: (o.real, o.imag, cmath.phase(e)) for k, (o, e) in spots.items()}
    numbers: Data = {"pairs": pairs, "home": {"drivers": {}, "poses": poses}}
    group = GeneralGroup(links={link: Link() for link in links}, **numbers)
    if _general_margin(group, spots, supports) < min_margin * SOFT:
        return None
    return Placed(numbers, spots, drives)


def _pair(
    chance: Random, tie: Tie, poses: Mapping[str, Spot], support: Spot | None
) -> tuple[Data, float]:
    """A pair where its links are, and its coordinate there."""
    if support is None:
        a = poses[tie.first][0] + cmath.rect(chance.uniform(0.2, 1.5), chance.uniform(-3.0, 3.0))
        u = cmath.rect(1.0, chance.uniform(-math.pi, math.pi))
    else:
        a, u = support
    slid = chance.uniform(-1.0, 1.0) if tie.kind == "P" else 0.0
    turned = chance.uniform(-3.0, 3.0) if tie.kind == "R" else 0.0
    b, w = a + slid * u, u * cmath.rect(1.0, turned)
    sides = [(tie.second, b, w)] if support else [(tie.first, a, u), (tie.second, b, w)]
    at, angle = [], []
    for link, point, direction in sides:
        o, e = poses[link]
        z = (point - o) / e
        at.append((z.real, z.imag))
        angle.append(cmath.phase(direction / e))
    data: Data = {"type": tie.kind, "driven": tie.driven}
    if support:
        data |= {"link": tie.second, "at": at[0], "slider": chance.choice(OWNERS)}
    else:
        data |= {"links": (tie.first, tie.second), "at": tuple(at)}
        data["slider"] = chance.choice(("i", "j"))
    if tie.guided:
        data["angle"] = angle[0] if support else tuple(angle)
    return data, turned if tie.kind == "R" else slid


def _general_margin(
    group: GeneralGroup, poses: Mapping[str, Spot], supports: Mapping[str, Spot]
) -> float:
    p = group.parameters()
    pose = tuple(LinkPosition(*poses[link]) for link in group.link_names)
    read = {name: Guide(*spot) for name, spot in supports.items()}
    inputs = tuple(
        read[j.name] if j.reads == "guide" else read[j.name].p
        for j in group.joints.values()
        if j.outer
    )
    at = tuple(ends(pair, pose, inputs, p) for pair in group.plans)
    return float(spread(jacobian(group.plans, at, len(pose), p)) ** 2)


PLACERS: dict[str, Callable[..., Placed | None]] = {
    "driver.crank": _crank,
    "driver.slide": _slide,
    "dyad.rrr": _rrr,
    "dyad.rrp": _rrp,
    "dyad.rpr": _rpr,
    "dyad.prp": _prp,
    "dyad.rpp": _rpp,
    "driven.rrr": _cylinder,
}
"""Block type -> how one is placed at random."""
