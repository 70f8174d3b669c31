"""Who is who in the gallery: links, joints and drivers of a joint-based form in the graph.

``graphs/NAME.json`` is wired by hand, ``graphs/joints/NAME.json`` is the same mechanism as
links and joints; frames of the links, places and loads are the same in both.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import blockmech as bm
from blockmech.mechanism import Mechanism

GRAPHS = Path(__file__).parents[1] / "graphs"
JOINTS = GRAPHS / "joints"
ROWS = {"n_four_bar", "parallelogram_chain"}  # of one dyad: what `SHORT` says, dearly
SHORT = sorted({path.stem for path in GRAPHS.glob("*.json")} - ROWS)


@cache
def mechanism(name: str) -> Mechanism:
    """A graph of the gallery, compiled."""
    return bm.Graph.load(GRAPHS / f"{name}.json").compile()


def document(name: str) -> dict[str, Any]:
    """What stands in a graph's file, for changes; without the numbers that it expects."""
    data: dict[str, Any] = json.loads((GRAPHS / f"{name}.json").read_text("utf-8"))
    data.pop("expect", None)
    return data


def changed(data: dict[str, Any]) -> Mechanism:
    """The mechanism of a changed file."""
    return bm.Graph.from_json(json.dumps(data)).compile()


@dataclass(frozen=True)
class Twins:
    """Names of the joint-based form, each with its address in the graph.

    links : link -> block.link
    joints : joint, or pin.link -> block.joint; a minus sign says that the graph's force is
        that of the document's second link on the first
    drivers : driver -> driver
    points : link.marker -> block.marker, and link -> block.marker at a link's origin
    turns : link -> direction, in the document's frame of the link, of the block's x axis
    reach : driver -> interval [rad or m] in which the two are compared, if not in general
    """

    links: Mapping[str, str]
    joints: Mapping[str, str]
    drivers: Mapping[str, str]
    points: Mapping[str, str] = field(default_factory=dict)
    turns: Mapping[str, complex] = field(default_factory=dict)
    reach: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def _names(pairs: str) -> dict[str, str]:
    return dict(item.split("=") for item in pairs.split())


def _twins(links: str, joints: str, drivers: str, points: str = "", **turns: complex) -> Twins:
    return Twins(_names(links), _names(joints), _names(drivers), _names(points), turns)


def _row(cell: str, first: int, number: int, drivers: str, **reach: tuple[float, float]) -> Twins:
    """Four-bars in a row: rods and rockers by number, as many cells."""
    numbers = [f"{first + k:02}" for k in range(number)]
    links = {"crank": "crank.crank"}
    joints = {"A": "crank.A"}
    for k, n in enumerate(numbers):
        links |= {f"rod{n}": f"{cell}{n}.i", f"rocker{n}": f"{cell}{n}.j"}
        # The pin at the end of a rod: the rod, its rocker, and the next rod.
        joints |= (
            {f"B{n}": f"{cell}{n}.B"} if k == 0 else {f"C{numbers[k - 1]}.rod{n}": f"{cell}{n}.B"}
        )
        last = k == number - 1
        joints |= {f"C{n}" if last else f"C{n}.rocker{n}": f"{cell}{n}.C", f"D{n}": f"{cell}{n}.D"}
    points = {f"rod{n}.C": f"{cell}{n}.C" for n in numbers[-1:]}
    return Twins(links, joints, _names(drivers), points, reach=reach)


TWINS: dict[str, Twins] = {
    "andrews_squeezer": _twins(
        "K1=crank.crank K2=first.i K3=first.j K4=upper.i K5=upper.j K6=lower.i K7=lower.j",
        "O=crank.A F=first.B P.K3=first.C B=first.D P.K4=upper.B P.K6=lower.B"
        " E=upper.C A5=upper.D H=lower.C A7=lower.D",
        "motor=crank",
        "K3.D=first.E",
    ),
    "elliptic_trammel": _twins(
        "shoe=shoe.slider bar=bar.i block=bar.j",
        "X=shoe.S B=bar.B C=bar.C Y=bar.S",
        "push=shoe",
        "bar.P=bar.P block=bar.C",
    ),
    "engine": _twins(
        "crankshaft=crank.crank rod=piston.i piston=piston.j",
        "main=crank.A crankpin=piston.B wristpin=piston.C cylinder=piston.S",
        "shaft=crank",
    ),
    "excavator": _twins(
        "boom=boom.j boom_barrel=boom.barrel boom_rod=boom.rod arm=arm.j arm_barrel=arm.barrel"
        " arm_rod=arm.rod bucket_barrel=curl.barrel bucket_rod=curl.rod rocker=curl.j"
        " link=bucket.i bucket=bucket.j",
        "boom_cylinder_foot=boom.B boom_cylinder=boom.S boom_cylinder_eye=boom.C boom_foot=boom.D"
        " arm_cylinder_foot=arm.B arm_cylinder=arm.S arm_cylinder_eye=arm.C arm_pivot=arm.D"
        " bucket_cylinder_foot=curl.B bucket_cylinder=curl.S knuckle.bucket_rod=-curl.C"
        " rocker_pivot=curl.D knuckle.link=bucket.B bucket_link_pin=bucket.C bucket_pivot=bucket.D",
        "lift=boom crowd=arm curl=curl",
        "bucket.tip=bucket.tip",
        boom=2.4 + 0.75j,
        arm=-0.65 + 0.35j,
        bucket=0.05 + 0.45j,
    ),
    "fivebar_falling": _twins(
        "left_crank=left.crank right_crank=right.crank left_rod=dyad.i right_rod=dyad.j",
        "A=left.A E=right.A B=dyad.B C=dyad.C D=dyad.D",
        "left=left right=right",
    ),
    "floating_drive_press": _twins(
        "left_upper=press.left_upper left_lower=press.left_lower right_upper=press.right_upper"
        " right_lower=press.right_lower barrel=press.barrel rod=press.rod ram=press.ram",
        "left_pivot=press.left_pivot right_pivot=press.right_pivot column=press.column"
        " left_knee.left_lower=press.left_knee_left_lower left_knee.barrel=press.left_knee_barrel"
        " right_knee.right_lower=press.right_knee_right_lower"
        " right_knee.rod=press.right_knee_rod cylinder=press.cylinder"
        " left_foot=press.left_foot right_foot=press.right_foot",
        "cylinder=press.cylinder",
        "ram.P=press.P",
    ),
    "geared_fivebar": _twins(
        "left_crank=first.crank right_crank=second.crank left_rod=dyad.i right_rod=dyad.j",
        "A=first.A E=second.A B=dyad.B C=dyad.C D=dyad.D",
        "first=first second=second",
    ),
    "hammer": _twins("hammer=hammer.crank", "A=hammer.A", "hammer=hammer", "hammer.head=hammer.B"),
    "planetary_hoist": _twins(
        "carrier=carrier.crank planet=planet.crank sun=sun.crank",
        "O=carrier.A S=sun.A P=planet.A",
        "carrier=carrier planet=planet sun=sun",
    ),
    "n_four_bar": _row("loop", 1, 40, "motor=crank", crank=(0.3, 2.8)),
    "oldham_coupling": _twins(
        "input=input.crank output=disc.i disc=disc.j",
        "O=input.A B=disc.B output_slot=disc.S1 input_slot=disc.S",
        "shaft=input",
        "disc=disc.O",
    ),
    "parallelogram_chain": _row("cell", 0, 30, "motor=crank", crank=(0.4, 2.7)),
    "pump": _twins(
        "crank=crank.crank rod=piston.i plunger=piston.j",
        "main=crank.A crankpin=piston.B crosshead=piston.C barrel=piston.S",
        "shaft=crank",
    ),
    "rack_gripper": _twins(
        "rack=rack.slider upper_pinion=upper.crank upper_finger=upper_finger.i"
        " upper_rocker=upper_finger.j lower_pinion=lower.crank lower_finger=lower_finger.i"
        " lower_rocker=lower_finger.j",
        "cylinder=rack.S upper_axle=upper.A upper_B=upper_finger.B upper_C=upper_finger.C"
        " upper_D=upper_finger.D lower_axle=lower.A lower_B=lower_finger.B"
        " lower_C=lower_finger.C lower_D=lower_finger.D",
        "cylinder=rack upper=upper lower=lower",
    ),
    "ruiz_fourbar": _twins(
        "crank=crank.crank coupler=dyad.i rocker=dyad.j",
        "A=crank.A B=dyad.B C=dyad.C D=dyad.D",
        "motor=crank",
        "coupler.S=dyad.S",
    ),
    "scissor_lift": _twins(
        "arm1=scissors.arm1 brace1=scissors.brace1 foot=scissors.foot arm2=scissors.arm2"
        " brace2=scissors.brace2 barrel=scissors.barrel rod=scissors.rod arm3=top.i brace3=top.j"
        " table=table.i roller=table.j",
        "base=scissors.base track=scissors.track foot_pin=scissors.foot_pin"
        " cross1=scissors.cross1 left1=scissors.left1 right1=scissors.right1"
        " cross2=scissors.cross2 cylinder_foot=scissors.cylinder_foot"
        " cylinder=scissors.cylinder cylinder_eye=scissors.cylinder_eye"
        " left2=top.B cross3=top.C right2=top.D"
        " table_pin=table.B table_track=table.S roller_pin=table.D",
        "lift=scissors.cylinder",
        "table.P=table.P",
    ),
    "scotch_yoke": _twins(
        "crank=crank.crank block=yoke.i yoke=yoke.j",
        "O=crank.A pin=yoke.B slot=yoke.S1 guide=yoke.S",
        "motor=crank",
        "yoke=yoke.O",
    ),
    "slider_crank": _twins(
        "crank=crank.crank rod=piston.i piston=piston.j",
        "O=crank.A A=piston.B B=piston.C cylinder=piston.S",
        "motor=crank",
        "piston=piston.C",
    ),
    "slider_crank_offset": _twins(
        "crank=crank.crank rod=piston.i piston=piston.j",
        "O=crank.A A=piston.B B=piston.C cylinder=piston.S",
        "motor=crank",
        "piston=piston.C",
    ),
    "stephenson_2_class_4": _twins(
        "crank=crank.crank coupler=loop.coupler upper=loop.upper lower=loop.lower"
        " rocker=loop.rocker",
        "A=crank.A B=loop.B C=loop.C D=loop.D E=loop.E F=loop.F G=loop.G",
        "motor=crank",
        "coupler.M=loop.M",
    ),
    "stephenson_3": _twins(
        "crank=crank.crank coupler=first.i rocker=first.j link=second.i output=second.j",
        "A=crank.A B=first.B C=first.C D=first.D P=second.B E=second.C F=second.D",
        "motor=crank",
        "coupler.P=first.P",
    ),
    "stephenson_3_triad": _twins(
        "crank=crank.crank coupler=triad.coupler plate=triad.plate rocker=triad.rocker"
        " output=triad.output",
        "A=crank.A B=triad.B C=triad.C D=triad.D E=triad.E F=triad.F G=triad.G",
        "motor=crank",
        "plate.M=triad.M",
    ),
    "stribeck_slider_crank": _twins(
        "crank=crank.crank rod=ram.i ram=ram.j",
        "O=crank.A A=ram.B B=ram.C guide=ram.S",
        "motor=crank",
        "ram=ram.C",
    ),
    "tangent_generator": _twins(
        "lever=lever.crank shoe=block.i block=block.j",
        "O=lever.A guide=block.S1 C=block.C slot=block.S2",
        "motor=lever",
        "shoe=block.C",
    ),
    "toggle_press": _twins(
        "crank=crank.crank rod=knee.i upper=knee.j lower=ram.i ram=ram.j",
        "O=crank.A A=knee.B knee.rod=-knee.C U=knee.D knee.lower=ram.B R=ram.C column=ram.S",
        "motor=crank",
        "ram=ram.C",
    ),
    "valve_engine": _twins(
        "crankshaft=crank.crank rod=piston.i piston=piston.j camshaft=camshaft.crank"
        " valve=valve.slider",
        "main=crank.A crankpin=piston.B wristpin=piston.C cylinder=piston.S bearing=camshaft.A"
        " guide=valve.S",
        "shaft=crank camshaft=camshaft valve=valve",
    ),
    "watt_sixbar": _twins(
        "crank=crank.crank coupler=first.i rocker=first.j left=second.i right=second.j",
        "O2=crank.A A=first.B B=first.C O4=first.D C=second.B E=second.C D=second.D",
        "motor=crank",
        "coupler.C=first.Cmid rocker.D=first.Dmid",
    ),
    "whitworth_shaper": _twins(
        "crank=crank.crank block=lever.i lever=lever.j rod=ram.i ram=ram.j",
        "O=crank.A crankpin=lever.B slot=lever.S D=lever.D T=ram.B C=ram.C way=ram.S",
        "motor=crank",
        "lever.T=lever.T ram=ram.C",
    ),
}
