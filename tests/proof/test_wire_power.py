"""What a wire carries away from one link arrives at the other, over the random mechanisms.

The power that a joint gives to the link of its marker (wrench times the marker's motion)
and the power that it gives to the block's own link (what the pair reports, at the pin or
at the slider's point, times the motion of that link) make up nothing but what friction
takes and the drive gives. Both sides are put together here from outputs alone.
"""

from __future__ import annotations

import cmath
from typing import Any

import pytest

from blockmech.model.structure import JointRef, MarkerRef
from blockmech.result import Result
from blockmech.values import Marker

from .test_random_mechanisms import SEEDS, case

BALANCED = 1e-13  # of the flow: the sizes of all force-times-speed terms at the wire


def _dot(a: complex, b: complex) -> float:
    return (a.conjugate() * b).real


class Ends:
    """Both ends of a wire in one sample."""

    def __init__(self, run: Result, joint: JointRef, marker: MarkerRef) -> None:
        self.structure = run.mechanism.structure
        self.value = {n: run[n][0] for n in run if run.output(n).kind in ("real", "vector")}
        self.joint, self.marker = joint, marker
        self.block = self.structure.blocks[joint.block]
        self.declared = self.block.joints[joint.name]
        self.driver = self.block.driver_name(*joint)

    def __call__(self, *parts: object) -> Any:
        return self.value[".".join(map(str, parts))]

    def _of_support(self, what: str) -> float:
        link = self.marker.on
        return 0.0 if link == self.structure.frame_link else float(self(link, what))

    def support(self) -> tuple[float, float]:
        """Power [W] that the marker's link gets, and the size of its terms."""
        F, M = self(self.joint, "wrench_F"), self(self.joint, "wrench_M")
        v, om = self(self.marker, "v"), self._of_support("omega")
        return _dot(F, v) + M * om, abs(F) * abs(v) + abs(M * om)

    def own(self) -> tuple[float, float]:
        """Power [W] that the block's own link gets, and the size of its terms."""
        link = f"{self.joint.block}.{self.declared.link}"
        p, v, om = self(link, "p"), self(link, "v"), self(link, "omega")
        along = self(self.joint, "friction") + self.drive()
        if self.declared.kind == "R":
            force, couple, place = self(self.joint, "reaction"), along, self(self.marker, "p")
        else:
            force, couple = (
                self(self.joint, "reaction") + along * self._guide(),
                self(self.joint, "C"),
            )
            place = self(self.marker, "p")
            if self.block.slider_owner(self.joint.name) == "later":
                own = self.block.slider_place(self.joint.name, self.declared.link)
                place = p + own * cmath.exp(1j * self(link, "angle"))
        speed = v + 1j * om * (place - p)
        size = abs(force) * (abs(v) + abs(om * (place - p))) + abs(couple * om)
        return _dot(force, speed) + couple * om, size

    def _guide(self) -> complex:
        """Direction of the guide: that of the marker, on its link."""
        declared = self.structure.marker(self.marker)
        turn = declared.direction if isinstance(declared, Marker) else 1.0
        fixed = self.marker.on == self.structure.frame_link
        return turn * (1.0 if fixed else cmath.exp(1j * self(self.marker.on, "angle")))

    def drive(self) -> float:
        """The driving effort, if this is the joint of a driver."""
        return float(self(self.driver, "drive")) if self.declared.driven else 0.0

    def given(self) -> float:
        """Power [W] that friction (negative) and the drive put in."""
        power = self(self.joint, "friction") * self(self.joint, "slip")
        drive = self.drive()
        return float(power + (drive * self(self.driver, "rate") if drive else 0.0))


@pytest.mark.parametrize("friction", ["none", "newton"])
def test_power_of_every_wire_balances(friction: str) -> None:
    worst, wires, rubbing = 0.0, 0, 0
    for seed in SEEDS:
        mechanism = case(seed).graph.compile()
        run = mechanism.run(**case(seed).request, friction=friction, on_gap="mark")
        if run.quality.status != ("ok",):
            continue
        for joint, marker in mechanism.structure.feeds.items():
            ends = Ends(run, joint, marker)
            (there, one), (here, other), given = ends.support(), ends.own(), ends.given()
            flow = one + other + abs(given)
            off = abs(there + here - given)
            assert off <= BALANCED * flow, f"seed {seed}: {marker} -> {joint} off {off / flow:.2g}"
            worst = max(worst, off / flow if flow else 0.0)
            wires += 1
            rubbing += bool(ends(joint, "friction"))
    print(f"{wires} wires, {rubbing} of them with friction, worst {worst:.1e}")
    assert wires > 4 * len(SEEDS)
    assert (rubbing > len(SEEDS)) == (friction == "newton")
