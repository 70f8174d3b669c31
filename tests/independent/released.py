"""Four-bars and five-bars under gravity, and their motion in absolute coordinates.

Documents of links, from random lengths and masses; the truth is `multibody.integrate`, which shares
no code with the package.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tests.independent import multibody as mb


def link(rng: Any, z: complex, w: complex, end: complex | None = None) -> dict[str, Any]:
    """A bar from one place to another, of random mass, its frame at the first along it."""
    length, mass = abs(w - z), rng.uniform(0.2, 2.0)
    pose = [z.real, z.imag, float(np.angle(w - z))]
    return {"mass": mass, "inertia": mass * length**2 / 12, "cm": [length / 2, 0.0], "pose": pose}


def pin(a: str, b: str, at: Any, on: Any) -> dict[str, Any]:
    """A pin of two links."""
    return {"type": "R", "links": [a, b], "at": [at, on]}


def document(links: Any, joints: Any, drivers: Any, rates: Any, name: str) -> dict[str, Any]:
    """A document whose drivers start where the poses are."""
    return {
        "format": "blockmech/joints",
        "version": 1,
        "name": name,
        "gravity": [0.0, -9.81],
        "links": links,
        "joints": joints,
        "drivers": {d: {"joint": j} for d, j in drivers.items()},
        "initial": {d: {"q": q, "rate": rate} for d, (q, rate) in rates.items()},
    }


def four_bar(rng: Any, kind: str) -> dict[str, Any]:
    """A double rocker, or a four-bar of which it is nearly or just not known whether it turns."""
    while True:
        a, b, c, d = rng.uniform(0.2, 1.0, 4)
        ends = min(a, b, c, d) + max(a, b, c, d)
        grashof = ends - (a + b + c + d - ends)  # > 0: a triple rocker
        if kind == "near":
            d = a + c - b + rng.choice([-1, 1]) * 1e-3
            if not 0.2 < d < 1.5 or {min(a, b, c, d), max(a, b, c, d)} not in ({a, c}, {b, d}):
                continue
        elif not grashof > 0.02 and b != min(a, b, c, d):
            continue
        theta = rng.uniform(0, math.tau)
        B, D = a * np.exp(1j * theta), complex(d)
        r = abs(D - B)
        if not abs(b - c) + 0.05 * r < r < b + c - 0.05 * r:
            continue
        alpha = math.acos((b * b + r * r - c * c) / (2 * b * r)) * rng.choice([-1, 1])
        C = B + b * (D - B) / r * np.exp(1j * alpha)
        links = {"l": link(rng, 0j, B), "m": link(rng, B, C), "r": link(rng, D, C)}
        joints = {
            "A": pin("frame", "l", [0.0, 0.0], [0.0, 0.0]),
            "B": pin("l", "m", [a, 0.0], [0.0, 0.0]),
            "C": pin("m", "r", [b, 0.0], [c, 0.0]),
            "D": pin("frame", "r", [d, 0.0], [0.0, 0.0]),
        }
        rate = float(rng.choice([-2.0, 2.0]))
        start = {"motor": (links["l"]["pose"][2], rate)}
        return document(links, joints, {"motor": "A"}, start, kind)


def five_bar(rng: Any) -> dict[str, Any]:
    """Two drivers, released at rest with the dyad well bent."""
    while True:
        a, b, c, d, e = rng.uniform(0.3, 1.0, 5)
        A, E = 0j, complex(e)
        B = a * np.exp(1j * rng.uniform(0, math.tau))
        D = E + d * np.exp(1j * rng.uniform(0, math.tau))
        r = abs(D - B)
        if not abs(b - c) + 0.2 * r < r < b + c - 0.2 * r:
            continue
        alpha = math.acos((b * b + r * r - c * c) / (2 * b * r)) * rng.choice([-1, 1])
        C = B + b * (D - B) / r * np.exp(1j * alpha)
        links = {
            "l": link(rng, A, B),
            "m": link(rng, B, C),
            "n": link(rng, D, C),
            "r": link(rng, E, D),
        }
        joints = {
            "A": pin("frame", "l", [0.0, 0.0], [0.0, 0.0]),
            "B": pin("l", "m", [a, 0.0], [0.0, 0.0]),
            "C": pin("m", "n", [b, 0.0], [c, 0.0]),
            "D": pin("r", "n", [d, 0.0], [0.0, 0.0]),
            "E": pin("frame", "r", [e, 0.0], [0.0, 0.0]),
        }
        start = {"one": (links["l"]["pose"][2], 0.0), "two": (links["r"]["pose"][2], 0.0)}
        return document(links, joints, {"one": "A", "two": "E"}, start, "fivebar")


def truth(case: dict[str, Any], times: Any, tolerance: float = 1e-13) -> Any:
    """Coordinates (n, k) of the drivers, counted."""
    system = mb.read(case)
    starts = case["initial"].values()
    poses = mb.assemble(system, system.home, [x["q"] for x in starts])
    rates = mb.rates(system, poses, [x["rate"] for x in starts])
    free = np.zeros(len(case["drivers"]))
    found, _ = mb.integrate(system, poses, rates, times, efforts=free, tolerance=tolerance)
    order = list(case["links"])
    counted = []
    for driver in case["drivers"].values():
        _, later = case["joints"][driver["joint"]]["links"]
        counted.append(found[:, order.index(later), 2])
    return np.array(counted).T
