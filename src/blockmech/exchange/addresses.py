"""The format ``address``: a mechanism at a pose as an address that opens in PMKS+.

Each pin is a joint; a guide is a joint that slides, pinned by a block without length to a pin of
the rider at its place, or welded to the rider. The line of a guide in a moving link goes through
two points that the link gets for it. Lengths are cm to a thousandth, so masses are g; the first
driver's rate is its speed. What PMKS+ has not is left out, which a line below the address says.

Source: PMKS-Web/PMKSWeb, ``src/app/services/transcoding``.
"""

from __future__ import annotations

import cmath
from typing import IO

from blockmech.exchange.drawing import UNITS as METRES
from blockmech.exchange.drawing import Inertia
from blockmech.exchange.formats import Order, Writer, file_writer
from blockmech.exchange.pmks_plus import (
    COUNTED,
    CURVE,
    DIGITS,
    GROUNDED,
    INPUT,
    NO_GRAVITY,
    PRISMATIC,
    RPM,
    UNITS,
    WELDED,
)
from blockmech.exchange.standing import Standing
from blockmech.ground.errors import listed, refused
from blockmech.model.structure import JointRef

CM = 1 / METRES["cm"]
SHOWN = 0b10011000  # grids, and forces as they were
PAGE = "https://app.pmksplus.com/?"


def base_64(value: int) -> str:
    """A whole number in digits of base 64, with a leading 0 as minus."""
    digits, rest = "", abs(value)
    while rest or not digits:
        digits, rest = DIGITS[rest % 64] + digits, rest // 64
    return f"0{digits}" if value < 0 else digits


def thousandths(*numbers: float) -> str:
    """Numbers in thousandths, with commas."""
    return ",".join(base_64(round(1000 * x)) for x in numbers)


class _Sheet:
    """Joints and links as PMKS+ writes them."""

    def __init__(self, order: Order) -> None:
        """Raises `RequestError` for couplings."""
        self.pose = pose = Standing(order)
        self.structure = s = pose.structure
        if s.followers:
            raise refused("--to address", "PMKS+ has no couplings", "leave them out")
        self.scene = order.mechanism._of_blocks.scene
        self.left = [f"loads {listed(s.elements)}"] * bool(s.elements)
        self.records: list[str] = []
        self.bodies: dict[str, list[str]] = {}
        self.blocks: list[tuple[str, str]] = []  # pin and slide of each
        self.driven = {ref: driver for driver, ref in s.driven.items()}
        pins = [ref for ref in pose.joints if ref not in pose.direction]
        for ref in pins:
            ends = [str(s.earlier_link(ref)), str(s.later_link(ref))]
            flags = GROUNDED * (str(s.frame_link) in ends)
            sense = -1 if ends[1] == str(s.frame_link) else 1
            speed, name = self._speed(ref, sense / RPM), pose.joint_name(ref)
            key = self._joint(flags, pose.pin(ref), speed=speed, name=name)
            for link in ends:
                if link != str(s.frame_link):
                    self.bodies.setdefault(link, []).append(key)
        positions = [pose.pin(ref) for ref in pose.joints]
        self.size = max(abs(z - positions[0]) for z in positions) or 1.0
        for ref in pose.direction:
            self._guide(ref)

    def _joint(
        self,
        flags: int,
        z: complex,
        angle: float = 0.0,
        line: str = "",
        speed: str = "",
        name: str = "",
    ) -> str:
        """Add a joint; its id."""
        count = len(self.records)
        key = chr(ord("A") + count % 26) + (str(count // 26) if count >= 26 else "")
        flags |= INPUT * bool(speed)
        coordinates = thousandths(z.real * CM, z.imag * CM, angle)
        line = line or ",,," * bool(speed)
        self.records.append(
            f"{DIGITS[flags]}{key},{_named(name or key)},{coordinates}{line}{speed}"
        )
        return key

    def _speed(self, ref: JointRef, factor: float) -> str:
        """The speed of a driven joint, "" of any other."""
        driver = self.driven.get(ref)
        if driver is None:
            return ""
        rate = float(getattr(self.scene.drive.get(driver), "rate", 0.0) or 10 * RPM)
        return f",{thousandths(rate * factor)}"

    def _guide(self, ref: JointRef) -> None:
        s, pose = self.structure, self.pose
        carrier, rider = str(s.earlier_link(ref)), str(s.later_link(ref))
        axis, z = pose.direction[ref], pose.point[ref]
        if rider == str(s.frame_link):
            carrier, rider, axis = rider, carrier, -axis
        line, flags = "", PRISMATIC | GROUNDED
        if carrier != str(s.frame_link):
            flags = PRISMATIC
            ends = [self._joint(0, z + k * self.size * axis / 2) for k in (-1, 1)]
            self.bodies.setdefault(carrier, []).extend(ends)
            line = f",\0{carrier}\0,{ends[0]},{ends[1]}"
        angle = 0.0 if line else cmath.phase(axis)
        key = self._joint(flags, z, angle, line, self._speed(ref, CM), pose.joint_name(ref))
        pin = self._joint(WELDED, z)
        points = self.bodies.setdefault(rider, [])
        points.append(pin)
        if len(points) == 1:  # a link has two joints at least
            points.append(self._joint(CURVE, z + 1j * self.size * axis / 8))
        self.blocks.append((pin, key))

    def code(self) -> str:
        """The whole code."""
        names = {link: "".join(points) for link, points in self.bodies.items()}
        units, links = UNITS["1"], []
        for ref in self.structure.links:
            link = str(ref)
            if link in names:
                properties = self.structure.properties(ref)
                body = Inertia(
                    float(properties.mass), float(properties.inertia), self.pose.centre(ref) * CM
                )
                numbers = (body.mass / units.mass, body.inertia / units.inertia)
                numbers_ = thousandths(*numbers, body.cm.real, body.cm.imag)
                joints = ",".join(self.bodies[link])
                links.append(
                    f"YR{names[link]},{_named(self.pose.called(ref))},{numbers_},c5cae9,{joints},,"
                )
        links += [f"YP{a}{b},{a}{b},0,0,0,0,,{a},{b},," for a, b in self.blocks]
        joints = ".".join(self.records)
        for link, name in names.items():
            joints = joints.replace(f"\0{link}\0", name)
        g = complex(self.scene.gravity.z)
        if g and abs(g + 9.81j) > 1e-2:
            self.left.append("gravity other than 9.81 m/s2 downward")
        flags = SHOWN | NO_GRAVITY * (not g)
        settings = f"{base_64(flags).rjust(2, '0')}.{thousandths(self.size * CM / 8, 5.0)}.A,0.1011"
        code = f"{settings}.{joints}..{'.'.join(links)}...N_"
        return code + COUNTED[len(code) % 62]


def _named(link: str) -> str:
    """A part's name without what separates fields."""
    return "".join(c if c.isalnum() or c in "_- " else "_" for c in link)[:40]


def write(order: Order, stream: IO[bytes]) -> None:
    """The address, and what was left out."""
    sheet = _Sheet(order)
    lines = [PAGE + sheet.code(), *(f"left out: {x}" for x in sheet.left)]
    stream.write("\n".join([*lines, ""]).encode())


WRITER = Writer(
    "PMKS+: an address that opens the mechanism there",
    (".pmksplus", ".pmks", ".address"),
    file_writer(write),
)
