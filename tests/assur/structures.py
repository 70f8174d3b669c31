"""Links and pairs without geometry: known mechanisms, random ones, and the rank of a Jacobian."""

from __future__ import annotations

import itertools
import random
from collections.abc import Collection, Iterable, Sequence
from typing import TypeAlias

import numpy as np

from blockmech.assur.diagnosis import diagnose
from blockmech.assur.formation import formation
from blockmech.assur.groups import Pair, Unit

FRAME = ("frame",)


def chain(text: str) -> tuple[list[str], list[Pair]]:
    """Links and pairs from words such as ``O:frame-crank S:frame-slider:P A:a-b:R@pin``."""
    pairs = []
    for word in text.split():
        name, ends, kind, *_ = [*word.split(":"), "R"]
        kind, _, axis = kind.partition("@")
        first, second = ends.split("-")
        assert kind in ("R", "P")
        pairs.append(Pair(name, first, second, "P" if kind == "P" else "R", axis))
    return sorted({a for p in pairs for a in p.links} - {"frame"}), pairs


def codes(text: str, *drivers: str) -> dict[str, tuple[str, ...]]:
    """Findings of a structure on the frame: code -> links."""
    return {f.code: f.links for f in diagnose(*chain(text), FRAME, drivers)}


def sequence(text: str, *drivers: str) -> str:
    """Formation sequence of a structure on the frame, which must be complete."""
    result = formation(*chain(text), FRAME, drivers)
    assert result.complete, result
    return str(result)


FOUR_BAR = "O:frame-crank A:crank-rod B:rod-rocker C:rocker-frame"

TRIAD = "TX:t-x TY:t-y TZ:t-z X:x-crank Y:y-frame Z:z-frame"

CLASS_IV = "K:t-a L:a-u M:u-b N:b-t T:t-frame U:u-crank"


def conditions(
    links: Sequence[str], pairs: Iterable[Pair], drivers: Collection[str], rng: np.random.Generator
) -> tuple[np.ndarray, list[str], np.ndarray]:
    """Velocity Jacobian at a random pose, the pair of each row, and the links' origins.

    Unknowns are the velocity of each link's own origin, placed at random, and its rate.
    """
    origin = {a: rng.normal(size=2) for a in links}
    axes: dict[tuple[str, str], np.ndarray] = {}
    rows, names = [], []
    for p in pairs:
        place = rng.normal(size=2)
        if p.axis:
            place = axes.setdefault((p.kind, p.axis), place)
        axis = place / np.linalg.norm(place)
        if p.kind == "R":
            directions = [(1.0, 0.0), (0.0, 1.0)]
        else:
            directions = [(-axis[1], axis[0])]
        turns = p.kind == "P" or p.name in drivers
        if p.kind == "P" and p.name in drivers:
            directions.append((axis[0], axis[1]))
        point = place if p.kind == "R" else rng.normal(size=2)
        for kind, direction in [("d", d) for d in directions] + [("t", (0.0, 0.0))] * turns:
            row = np.zeros(3 * len(links))
            for a, sign in ((p.first, 1.0), (p.second, -1.0)):
                if a in origin:
                    k = 3 * links.index(a)
                    arm = point - origin[a]
                    if kind == "t":
                        row[k + 2] += sign
                    else:
                        lever = direction[1] * arm[0] - direction[0] * arm[1]
                        row[k : k + 3] += sign * np.array([*direction, lever])
            rows.append(row)
            names.append(p.name)
    origins = np.array([origin[a] for a in links])
    return np.array(rows).reshape(len(rows), 3 * len(links)), names, origins


def null_space(matrix: np.ndarray) -> np.ndarray:
    """Orthonormal columns that the matrix takes to zero; the gap in its values is asserted."""
    if not matrix.size:
        return np.eye(matrix.shape[1])
    _, values, right = np.linalg.svd(matrix)
    rank = int(np.sum(values > 1e-9))
    assert not np.any((values > 1e-12) & (values < 1e-9)), values
    return right[rank:].T


def random_structure(rng: random.Random) -> tuple[list[str], list[Pair], list[str]]:
    """A few links with about as many pairs as they need, shared axes and drivers among them."""
    n = rng.randint(1, 9)
    links = [f"l{k}" for k in range(n)]
    reachable = ["frame", *links]
    pairs = []
    slides = rng.choice([0.0, 0.2, 0.5, 1.0])
    count = max(1, round(1.5 * n) + rng.choice([-2, -1, 0, 0, 0, 1, 2]))
    for k in range(count):
        a = links[k] if k < n else rng.choice(links)  # mostly connected
        b = rng.choice(
            [x for x in reachable[: links.index(a) + 1] if x != a] if k < n else reachable
        )
        if a == b:
            continue
        kind = "P" if rng.random() < slides else "R"
        axis = rng.choice(["x", "y", "", "", "", ""]) if rng.random() < 0.4 else ""
        pairs.append(Pair(f"j{k}", a, b, "P" if kind == "P" else "R", axis))
    rng.shuffle(pairs)
    drivers = [p.name for p in pairs if rng.random() < 0.15]
    return links, pairs, drivers


def check_units(units: Iterable[Unit], pairs: Sequence[Pair], drivers: Collection[str]) -> None:
    """Each unit is balanced, stands on earlier ones, and no part of it is balanced."""
    placed = {"frame"}
    for unit in units:
        unit_pairs = [p for p in pairs if set(p.links) <= placed | set(unit.links)]
        unit_pairs = [p for p in unit_pairs if not set(p.links) <= placed]
        assert sorted(p.name for p in unit_pairs) == sorted(p.name for p in unit.pairs)
        assert unit.driven == tuple(sorted(p.name for p in unit_pairs if p.name in drivers))
        if len(unit.links) <= 7:
            for size in range(1, len(unit.links)):
                for part in itertools.combinations(unit.links, size):
                    inside = [p for p in unit_pairs if set(p.links) <= placed | set(part)]
                    constraints = 2 * len(inside) + sum(p.name in drivers for p in inside)
                    assert constraints < 3 * size, (unit, part)
        placed |= set(unit.links)


Mechanism: TypeAlias = tuple[list[str], list[Pair], list[str], list[int]]


def random_mechanism(rng: random.Random, shared: float = 0.0) -> Mechanism:
    """A determinate mechanism made of drivers, dyads, triads and class IV groups.

    Links, pairs, drivers and the numbers of links of the units. ``shared``: how often a
    foot stands on a pin that is already there.
    """
    placed, pairs, drivers, sizes = ["frame"], list[Pair](), list[str](), list[int]()
    pins: list[tuple[str, str]] = []  # a link and a pin on it
    names = iter(rng.sample(range(1000), 600))

    def join(a: str, b: str, kind: str = "R", axis: str = "") -> None:
        ends = (a, b) if rng.random() < 0.5 else (b, a)
        axis = axis or f"pin{next(names)}"
        pairs.append(Pair(f"j{next(names)}", *ends, "P" if kind == "P" else "R", axis))
        if kind == "R":
            new_pins.append((a, axis))

    for _ in range(rng.randint(1, 12)):
        size = rng.choice([1, 1, 2, 2, 2, 4, 5])
        new = [f"l{next(names)}" for _ in range(4 if size == 5 else size)]
        new_pins: list[tuple[str, str]] = []
        feet = [(rng.choice(placed), "") for _ in range(3)]
        if rng.random() < shared and len({axis for _, axis in pins}) >= 3:
            feet = [(a, x) for x, a in rng.sample(sorted({x: a for a, x in pins}.items()), 3)]
        if size == 1:
            kind = rng.choice("RP")
            join(new[0], feet[0][0], kind, feet[0][1] if kind == "R" else "")
            drivers.append(pairs[-1].name)
        elif size == 2:
            letters = rng.choice(["RRR", "RRP", "RPR", "PRP", "RPP"])
            join(new[0], new[1], letters[1])
            for a, (b, axis), kind in zip(new, feet, letters[::2], strict=False):
                join(a, b, kind, axis if kind == "R" else "")
        elif size == 4:
            for leg, (foot, axis) in zip(new[1:], feet, strict=True):
                join(new[0], leg)
                join(leg, foot, "R", axis)
        else:
            for a, b in zip(new, new[1:] + new[:1], strict=True):
                join(a, b)
            join(new[0], feet[0][0], "R", feet[0][1])
            join(new[2], feet[1][0], "R", feet[1][1])
        sizes.append(len(new))
        placed += new
        pins += new_pins
    rng.shuffle(pairs)
    return rng.sample(placed[1:], len(placed) - 1), pairs, drivers, sorted(sizes)


def dyad_chain(count: int, rng: random.Random) -> tuple[list[str], list[Pair]]:
    """A crank and so many dyads in a row, shuffled."""
    links, pairs, last = ["crank"], [Pair("O", "frame", "crank")], "crank"
    for k in rng.sample(range(count), count):
        links += [f"i{k}", f"j{k}"]
        pairs += [
            Pair(f"B{k}", last, f"i{k}"),
            Pair(f"C{k}", f"i{k}", f"j{k}"),
            Pair(f"D{k}", "frame", f"j{k}"),
        ]
        last = f"j{k}"
    rng.shuffle(pairs)
    return links, pairs
