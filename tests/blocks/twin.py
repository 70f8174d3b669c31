"""The same mechanism for the independent judge: a compiled mechanism as a multibody system.

Links are named ``block.link``, joints ``block.joint``, drivers and elements like
their blocks; "frame" is the fixed link. The assembly mode is told by poses alone.
"""

from dataclasses import replace

import numpy as np

import blockmech as bm
from blockmech.blocks.contract import BuiltIn, Line
from blockmech.model.structure import JointRef
from tests.independent import comparison
from tests.independent import multibody as mb

TURN = 2 * np.pi


class Twin:
    """A mechanism and its multibody system."""

    def __init__(self, mechanism):
        self.mechanism = mechanism
        self.structure = mechanism.structure
        self.system = mb.System(
            links={str(link): self._link(link) for link in self._moving()},
            joints=dict(self._joints()),
            drivers={d: self._driver(d) for d in self.structure.drivers},
            loads={
                name: self._load(name, element) for name, element in self.structure.elements.items()
            },
            gravity=pair(mechanism.scene.gravity.z),
        )

    def _moving(self):
        return [link for link in self.structure.links if link != self.structure.frame_link]

    def _name(self, link):
        return "frame" if link == self.structure.frame_link else str(link)

    def _link(self, link):
        p = self.structure.properties(link)
        return mb.Link(p.mass, p.inertia, pair(p.cm.z))

    def _place(self, marker):
        """Place and angle of a marker in its link's frame."""
        declared = self.structure.marker(marker)
        if isinstance(declared, BuiltIn):
            block = self.structure.block(marker.block)
            return (getattr(block, declared.along) if declared.along else 0.0, 0.0), 0.0
        return pair(declared.at.z), float(np.angle(declared.direction))

    def _joints(self):
        for name, block in self.structure.blocks.items():
            for joint in block.joints.values():
                yield f"{name}.{joint.name}", self._joint(JointRef(name, joint.name), block, joint)

    def _joint(self, ref, block, joint):
        earlier, later = self.structure.earlier_link(ref), self.structure.later_link(ref)
        friction = block.friction.get(joint.name)
        if joint.outer:
            at, angle = self._place(self.structure.feeds[ref])
        else:
            at, angle = self._side(block, joint, earlier.link)
        own_at, own_angle = self._side(block, joint, later.link)
        return mb.Joint(
            joint.kind,
            (self._name(earlier), self._name(later)),
            (at, own_at),
            (angle, own_angle),
            slider=int(block.slider_owner(joint.name) == "later"),
            friction=friction
            and mb.Friction(friction.coefficient, friction.radius or 0.0, friction.guide_length),
        )

    def _side(self, block, joint, link):
        """Place and angle of a pair on one of its block's own links."""
        if isinstance(block, bm.GeneralGroup):
            side = block.pairs[joint.name].sides[link]
            return pair(side.at.z), float(np.angle(side.direction))
        if joint.kind == "P":
            return on_line(block, joint, link)
        return self._pin(block, joint, link), 0.0

    def _pin(self, block, joint, link):
        """Place of a pin on a link: the built-in marker there that bears the joint's name."""
        for name in (joint.name, f"{joint.name}j"):
            on, marker = block.all_markers.get(name, ("", None))
            if on == link:
                return (getattr(block, marker.along) if marker.along else 0.0, 0.0)
        raise LookupError(f"no marker for joint {joint.name} on link {link}")

    def _driver(self, name):
        return mb.Driver(joint=str(self.structure.driven[name]))

    def _load(self, name, element):
        held = {t: self.structure.holds[JointRef(name, t)] for t in element.terminals}
        links = tuple(self._name(m.on) for m in held.values())
        places = tuple(self._place(m)[0] for m in held.values())
        if isinstance(element, bm.Force):
            return mb.Force(links[0], places[0], pair(element.force.z), element.axes)
        if isinstance(element, bm.Couple):
            return mb.Couple(links[0], element.moment)
        if isinstance(element, bm.Spring):
            numbers = element.stiffness, element.free_length, element.damping
            return mb.Spring(links, places, *numbers)
        numbers = element.stiffness, element.rest_angle, element.damping
        return mb.TorsionSpring(*numbers, links=links)

    # -- the judge's answer at a sample ----------------------------------------------------

    def judge(self, q, qd, qdd, friction=True):
        """Everything at one sample: driver coordinates, rates and accelerations (d,)."""
        guess = self._guess(q)
        coordinates = self._coordinates(q, guess)  # winds the guess as well
        poses = mb.assemble(self.system, guess, coordinates, refine=True)
        return comparison.verdict(self.system, poses, qd, qdd, friction)

    def _coordinates(self, q, poses):
        """The judge's driver coordinates: it does not know of offsets and directions.

        A crank's angle counts turns, so its pose is wound to it; the angle of a pair inside
        a group is brought to the turn in which the poses (n, 3) are.
        """
        copy = np.asarray(q, float).copy()
        rows = {str(link): k for k, link in enumerate(self._moving())}
        for k, ref in enumerate(self.structure.driven.values()):
            block = self.structure.blocks[ref.block]
            copy[k] += getattr(block, "offset", 0.0)
            if self.structure.joint(ref).kind == "P":
                continue
            joint = self.system.joints[str(ref)]
            copy[k] += joint.angle[0] - joint.angle[1]
            first, second = (rows.get(link) for link in joint.links)
            base = 0.0 if first is None else poses[first, 2]
            if isinstance(block, bm.GeneralGroup):
                copy[k] += TURN * np.round((poses[second, 2] - base - copy[k]) / TURN)
            else:
                poses[second, 2] = base + copy[k]
        return copy

    def _guess(self, q):
        """Poses by blockmech itself: they fix the assembly mode, the judge refines them."""
        want = [f"{link}.{x}" for link in self._moving() for x in ("p", "angle")]
        at = dict(zip(self.structure.drivers, q, strict=True))
        run = self.mechanism.run(at=at, rates=dict.fromkeys(at, 0.0), want=want)
        rows = [
            (run[f"{link}.p"][0].real, run[f"{link}.p"][0].imag, run[f"{link}.angle"][0])
            for link in self._moving()
        ]
        return np.array(rows)


class Comparison:
    """A mechanism and its twin at one request; friction where it is idle is left to blockmech."""

    def __init__(self, mechanism, request, friction=True):
        self.mechanism = mechanism
        method = "newton" if friction else "none"
        self.run = mechanism.run(**request, friction=method, on_gap="mark")
        twin = Twin(mechanism)
        twin.system = without_idle_friction(twin.system, self.run)
        states = [[request[k][d] for d in mechanism.drivers] for k in REQUEST]
        self.judge = twin.judge(*states, friction)

    def outcome(self):
        """How either settled the friction: ok, or two words that must mean the same."""
        solved, (status,) = self.judge.forces.converged, self.run.quality.status
        return "ok" if status == "ok" and solved else f"{status}, judge {SAID[solved]}"

    def wrong(self, motion, forces):
        """Outputs that are further off than the tolerances, which are of the conditioning."""
        result = {n: e for n, e in comparison.motion(self.run, self.judge) if not e <= motion}
        off = {n: e for n, e in comparison.forces(self.run, self.judge) if not e <= forces}
        return result | off


REQUEST = ("at", "rates", "accelerations")
SAID = {True: "solved", False: "not"}


def without_idle_friction(system, run):
    """The judge's system, smooth where blockmech has a structural zero.

    The judge computes 1e-56 N there and then asks friction to follow that rounding.
    """

    def idle(name):
        return run[f"{name}.reaction"][0] == 0 and run.get(f"{name}.C", [0.0])[0] == 0

    joints = {n: replace(j, friction=None) if idle(n) else j for n, j in system.joints.items()}
    return replace(system, joints=joints)


def on_line(block, joint, link):
    """Place and angle of a P joint's line on one of the block's links."""
    turn = joint.lines.get(link, Line()).turn
    return pair(block.slider_place(joint.name, link)), getattr(block, turn) if turn else 0.0


def pair(z):
    return (z.real, z.imag)
