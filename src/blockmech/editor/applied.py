"""What acts on a drawing: couplings, loads and masses, at first of the sizes that are drawn."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable

import numpy as np

from blockmech.blocks.registry import REGISTRY
from blockmech.editor.fields import with_item
from blockmech.editor.pins import guide_of, outlines_of, pins_of, sides_of
from blockmech.editor.sketching import Form, both_pins, driven, on_link, with_joint
from blockmech.ground.errors import listed, refused
from blockmech.ground.names import numbered_name
from blockmech.model.joints.contents import FRAME

BAR = 1.0  # [kg/m] of a bar whose mass nobody has said
CAM = 10.0  # distance of a cam's follower from its shaft, over rise and roller of a new one
PAIRS = {"R": "a joint that turns", "P": "a joint that slides"}


def coupled(form: Form, names: Iterable[str], kind: str) -> Form:
    """With a gear, rack, cam or belt by which the first of two joints moves the second.

    Sizes are those of the drawing: wheels of equal size that meet, a pinion that reaches the
    rack, a cam whose roller stands at the follower's joint. A pin of one link is put on the
    frame. Raises `RequestError` for joints of other kinds, and for one that follows another
    already.
    """
    ends, couplings = list(both_pins(names)), form.get("couplings", {})
    for name in ends:
        form = with_joint(form, name)
    pairs = REGISTRY[f"coupling.{kind}"].pairs
    kinds = "".join(form["joints"].get(name, {}).get("type", "-") for name in ends)
    if kinds not in pairs:
        needed = " or ".join(" and ".join(PAIRS[kind] for kind in pair) for pair in pairs)
        raise refused(listed(ends), f"a {kind} needs {needed}, in this order", "choose two such")
    for name in ends:
        if not pins_of(form)[name].driven:
            form = driven(form, [name])
    of = {driver_data["joint"]: driver for driver, driver_data in form["drivers"].items()}
    for driver in (of[end] for end in ends):
        if driver in {driver_data["driven"] for driver_data in couplings.values()}:
            raise refused(driver, "it follows another joint already", "choose another joint")
    form = with_item(form, ("drivers", of[ends[1]]), {"joint": ends[1]})  # it has no own law
    sizes = _coupling_sizes(form, ends, kinds, kind)
    coupling = {"type": kind, "driver": of[ends[0]], "driven": of[ends[1]], **sizes}
    return dict(with_item(form, ("couplings", numbered_name(kind, couplings)), coupling))


def _coupling_sizes(form: Form, ends: list[str], kinds: str, kind: str) -> Form:
    """Sizes of a coupling as it is drawn."""
    a, b = (pins_of(form)[name].z for name in ends)
    if kind == "gear":
        return {"teeth": [20, 20]}
    if kind == "belt":
        return {"radii": [abs(b - a) / 4] * 2}
    if kind == "rack":
        axis = cmath.rect(1.0, guide_of(form, ends[kinds.index("P")]))
        off = ((b - a) * axis.conjugate()).imag
        return {"radius": abs(off) or abs(b - a), "side": 1 if (off > 0) == (kinds == "PR") else -1}
    rise = abs(b - a) / CAM
    up = {"motion": "4-5-6-7", "over": math.pi, "rise": rise}
    law = {"kind": "segments", "segments": [up, {**up, "rise": -rise}]}
    return {"law": law, "follower": "roller", "roller": rise}


def loaded(form: Form, names: Iterable[str], kind: str) -> Form:
    """With a force at each of some pins, or a spring between two; both at rest as drawn."""
    pins = pins_of(form)
    ends = both_pins(names) if kind == "spring" else list(names)
    for name in ends:
        if not pins[name].links:
            raise refused(name, "no link is there to hold it", "draw a link to the pin first")
    on = [next((x for x in reversed(pins[n].links) if x != FRAME), FRAME) for n in ends]
    at = [on_link(form, link, pins[name].z) for link, name in zip(on, ends, strict=True)]
    if kind == "spring":
        free_length = abs(pins[ends[0]].z - pins[ends[1]].z)
        loads = [{"links": on, "at": at, "stiffness": 1000.0, "free_length": free_length}]
    else:
        loads = [{"force": [0.0, -10.0], "link": x, "at": z} for x, z in zip(on, at, strict=True)]
    for load in loads:
        name = numbered_name(kind, form.get("loads", {}))
        form = with_item(form, ("loads", name), {"type": kind, **load})
    return form


def weighed(form: Form, names: Iterable[str]) -> Form:
    """With the mass of bars along the outlines of links that have none, of links at pins."""
    pins = pins_of(form)
    for link, ends in outlines_of(pins).items():
        massless = form["links"][link]
        a, b = np.array([(pins[a].z, pins[b].z) for a, b in sides_of(ends)] or [(0j, 0j)]).T
        lengths, middles = np.abs(b - a), (a + b) / 2
        mass = BAR * float(lengths.sum())
        if not {*ends} & {*names} or massless.get("mass") or not mass:
            continue
        cm = complex(np.average(middles, weights=lengths))
        inertia = BAR * float(lengths @ (lengths**2 / 12 + np.abs(middles - cm) ** 2))
        body = {"mass": mass, "inertia": inertia, "cm": on_link(form, link, cm)}
        form = with_item(form, ("links", link), {**massless, **body})
    return form
