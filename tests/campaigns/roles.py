"""Random machines with prescribed, locked and free drivers, beside absolute coordinates: a script.

    python -m tests.campaigns.roles [--cases 40] [--first 0]

Arms of two and three links, five-bars, a bead on a rod, a pendulum on a cart; each driver is free,
follows a harmonic, or is locked; every other case has dry joints, the others stops that let a free
driver bounce. The judge is `tests.independent.driven`, which shares no code with the package; how
far it is from itself at a coarser tolerance is how good a judge it is. A line is a case: errors of
coordinates and rates at its end, the judge's own, and how many events both saw. The word ABOVE
stands where more is off than is stated, by more than the judge is, or than 1e-8.
"""

from __future__ import annotations

import argparse
import copy
import math
from typing import Any

import numpy as np

import blockmech as bm
from blockmech.ground.plane import EPS
from tests.independent import driven
from tests.independent import multibody as mb
from tests.independent.released import document, five_bar, link, pin
from tests.independent.test_sticking import BEAD, CART

SPAN = 0.6  # [s] of a motion
RADIUS = 0.05  # [m] of dry pins
JUDGE, COARSER = 1e-13, 1e-12  # tolerances of the judge, and of that which judges it


def arm(rng: Any, count: int) -> dict[str, Any]:
    """Links in series on the frame, each moved by a driver."""
    lengths, angles = rng.uniform(0.3, 1.0, count), rng.uniform(-1.5, 1.5, count)
    heads = np.exp(1j * np.cumsum(angles))
    ends = np.append(0j, np.cumsum(lengths * heads))
    names = ["frame", *(f"l{i}" for i in range(count))]
    links = {names[i + 1]: link(rng, ends[i], ends[i + 1]) for i in range(count)}
    joints = {
        f"J{i}": pin(names[i], names[i + 1], [lengths[i - 1] if i else 0.0, 0.0], [0.0, 0.0])
        for i in range(count)
    }
    starts = {f"d{i}": (float(angles[i]), 0.0) for i in range(count)}
    return document(links, joints, {f"d{i}": f"J{i}" for i in range(count)}, starts, "arm")


def case_of(seed: int) -> tuple[dict[str, Any], dict[str, str], dict[str, Any], Any]:
    """A document, the role of each driver, its law if it has one, and (driver, stop) or None."""
    rng = np.random.default_rng([seed, 39])
    kind = ("arm2", "arm3", "fivebar", "bead", "cart")[seed % 5]
    if kind.startswith("arm"):
        case = arm(rng, int(kind[3:]))
    elif kind == "fivebar":
        case = five_bar(rng)
    else:
        case = copy.deepcopy(BEAD if kind == "bead" else CART)
        starts = {"bead": {"hub": 0.3, "slot": 0.4}, "cart": {"rail": 0.0, "pin": -0.4}}[kind]
        case["initial"] = {d: {"q": q, "rate": 0.0} for d, q in starts.items()}
    drivers = list(case["drivers"])
    free = drivers[int(rng.integers(len(drivers)))]
    roles = {d: str(rng.choice(["prescribed", "locked", "free"])) for d in drivers}
    roles[free] = "free"
    if set(roles.values()) == {"free"}:
        bound = next(d for d in drivers if d != free)
        roles[bound] = str(rng.choice(["prescribed", "locked"]))
    laws = dict[str, Any]()
    for d, role in roles.items():
        start = case["initial"][d]
        if role == "prescribed":
            phase, amplitude = float(rng.uniform(0, math.tau)), float(rng.uniform(0.05, 0.3))
            mean = start["q"] - amplitude * math.sin(phase)
            wave = {"amplitude": amplitude, "frequency": float(rng.uniform(0.4, 1.5))}
            laws[d] = bm.motion.Harmonic(mean=mean, phase=phase, **wave)
            start["rate"] = float(laws[d].at_times(np.zeros(1))[1][0])
        elif role == "free":
            start["rate"] = float(rng.choice([0.0, rng.normal()]))
    if seed % 2:
        q, room = case["initial"][free]["q"], rng.uniform(0.02, 0.3, 2)
        return case, roles, laws, (free, q - room[0], q + room[1], float(rng.uniform(0.6, 0.9)))
    for name, joint in case["joints"].items():
        if rng.random() < 0.6 or name == next(iter(case["joints"])):
            dry = {"law": "coulomb", "coefficient": float(rng.uniform(0.05, 0.6))}
            joint["friction"] = dry | ({"radius": RADIUS} if joint["type"] == "R" else {})
    return case, roles, laws, None


def compared(seed: int, accuracy: float) -> tuple[float, float, float, list[str], Any]:
    """Errors of coordinates and rates at the end, the judge's own, its events, and the motion."""
    case, roles, laws, stop = case_of(seed)
    data = copy.deepcopy(case)
    for d, law in laws.items():
        data["drivers"][d] |= law.model_dump(
            include={"law", "mean", "amplitude", "frequency", "phase"}
        )
    linkage = bm.Linkage.from_data(data)
    if stop is not None:
        linkage.add_stop(stop[0], low=stop[1], high=stop[2], restitution=stop[3])
    request = {"accuracy": accuracy, "roles": roles, "want": ()}
    motion = linkage.compile().simulate(f"time={SPAN}", **request).motion
    drivers, drives = list(case["drivers"]), dict[int, driven.Drive]()
    for i, d in enumerate(drivers):
        if d in laws:
            drives[i] = lambda t, law=laws[d]: tuple(
                float(x[0]) for x in law.at_times(np.array([t]))
            )
        elif roles[d] == "locked":
            drives[i] = lambda t, q=case["initial"][d]["q"]: (q, 0.0, 0.0)
    bound = {case["drivers"][drivers[i]]["joint"] for i in drives}  # their drives take friction
    factors = {
        name: joint["friction"]["coefficient"] * joint["friction"].get("radius", 1.0)
        for name, joint in case["joints"].items()
        if "friction" in joint and name not in bound
    }
    bare = copy.deepcopy(case)
    for joint in bare["joints"].values():
        joint.pop("friction", None)
    stops = {} if stop is None else {drivers.index(stop[0]): stop[1:]}
    machine = driven.Machine(mb.read(bare), drives, factors, stops)
    q, rate = (np.array([x[key] for x in case["initial"].values()]) for key in ("q", "rate"))
    poses = mb.assemble(machine.system, machine.system.home, q)
    start = machine, poses, mb.rates(machine.system, poses, rate), SPAN
    q, rate, events = driven.moved(*start, JUDGE)
    judge = float(np.abs(driven.moved(*start, COARSER)[0] - q).max())
    apart = motion.q_end - q
    rotary = [case["joints"][x["joint"]]["type"] == "R" for x in case["drivers"].values()]
    apart -= np.where(rotary, math.tau * np.round(apart / math.tau), 0.0)
    errors = float(np.abs(apart).max()), float(np.abs(motion.qd_end - rate).max())
    return *errors, judge, events, motion


def main() -> None:
    """Run the cases."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--accuracy", type=float, default=1e-10)
    options = parser.parse_args()
    for seed in range(options.first, options.first + options.cases):
        try:
            q, rate, judge, events, motion = compared(seed, options.accuracy)
        except Exception as failure:  # a case of its own
            print(seed, "RAISED", repr(failure)[:100], str(failure)[:300], flush=True)
            continue
        above = "" if q <= min(motion.error + judge, 1e-8) + EPS else "ABOVE"
        counts = f"events {len(events)} slips {len(motion.slips)} impacts {len(motion.impacts)}"
        roles = "".join(role[0] for role in motion.roles[0].of.values())
        verdict = (
            f"stated {motion.error:.1e} {above} {counts} end {motion.end} at {motion.t_end:.6g} s"
        )
        errors = f"q {q:.1e} judge {judge:.0e} rate {rate:.1e}"
        print(f"{seed} {roles} {errors} {verdict}", flush=True)


if __name__ == "__main__":
    main()
