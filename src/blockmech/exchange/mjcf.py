"""The format ``mjcf``: a mechanism for MuJoCo, at a pose.

A tree of bodies hangs on the frame, by driven pairs first, then by guides; every other pair is a
pin and closes a loop by ``equality/connect``. A guide never does: the angles of a loop of guides
and driven pairs add up to nothing, so its drivers were not free. All bodies have the frame's axes
at the pose that is written, so coordinates count from there. Gravity lies in the plane of the
mechanism; MuJoCo's contact and damping are off. The solver's time constant is two steps, as small
as it may be: constraints are then met to the square of the step.

Source: MuJoCo documentation, XML reference (``body``, ``joint``, ``equality/connect``).
"""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np

from blockmech.exchange.formats import Order, Writer, file_writer
from blockmech.exchange.standing import Standing
from blockmech.ground.errors import listed, printable, refused
from blockmech.model.structure import JointRef, LinkRef

LEAST = 1e-9  # kg and kg m2: MuJoCo moves nothing without mass
STEP = 1e-4  # [s]


class Model:
    """The tree of a mechanism, and what closes it."""

    def __init__(self, order: Order) -> None:
        """Raises `RequestError` for couplings, and where a loop closes at a link without mass."""
        import networkx as nx

        self.mechanism = mechanism = order.mechanism._of_blocks
        self.structure = s = mechanism.structure
        if s.followers:
            raise refused("--to mjcf", "a coupling has no element there", "leave it out")
        self.step = order.positive("step", STEP, "s", "0.1ms")
        self.pose = pose = Standing(order)
        refs, guides = pose.joints, pose.direction
        self.drivers = driven = {ref: d for d, ref in s.driven.items()}
        graph = nx.Graph()
        for ref in refs:
            rank = 0 if ref in driven else 1 if ref in guides else 2 if self._light(ref) else 3
            graph.add_edge(s.earlier_link(ref), s.later_link(ref), ref=ref, rank=rank)
        tree = nx.minimum_spanning_tree(graph, weight="rank")
        edges = nx.bfs_edges(tree, s.frame_link)
        self.parent = {link: (base, tree.edges[base, link]["ref"]) for base, link in edges}
        hung = {ref for _, ref in self.parent.values()}
        self.loops = [ref for ref in refs if ref not in hung]
        if light := [str(link) for ref in self.loops for link in self._light(ref)]:
            message = (
                f"a loop closes at {listed(light)} without mass, which MuJoCo holds only roughly"
            )
            raise refused("--to mjcf", message, "give it mass and inertia")

    def _light(self, ref: JointRef) -> list[LinkRef]:
        """Moving links of a pair that have neither mass nor inertia.

        MuJoCo softens what closes a loop in proportion to the inverse of its links' inertia.
        """
        s = self.structure
        moving = {s.earlier_link(ref), s.later_link(ref)} - {s.frame_link}
        bodies = ((link, s.properties(link)) for link in sorted(moving))
        return [link for link, of in bodies if not (float(of.mass) or float(of.inertia))]

    def text(self) -> str:
        """The whole file."""
        mechanism, s = self.mechanism, self.structure
        g = complex(mechanism.scene.gravity.z)
        omitted = [f"loads: {listed(s.elements, 30)}"] if s.elements else []
        omitted += [f"friction: {listed(mechanism.frictional_joints)}"] * bool(
            mechanism.frictional_joints
        )
        lines = [
            f"<mujoco model={quoteattr(printable(mechanism.name))}>",
            *(f"  <!-- left out: {printable(x).replace('--', '- -')} -->" for x in omitted),
            f'  <option timestep="{self.step!r}" gravity="{g.real!r} {g.imag!r} 0"'
            ' integrator="RK4" iterations="200" tolerance="1e-15">',
            '    <flag contact="disable"/>',
            "  </option>",
            '  <compiler angle="radian" balanceinertia="true"/>',
            f'  <default><equality solref="{2 * self.step!r} 1" solimp="0.9999 0.9999 0.001"/>'
            "</default>",
            "  <worldbody>",
            *self._bodies(s.frame_link, 0j, 2),
            "  </worldbody>",
        ]
        if self.loops:
            lines += ["  <equality>", *map(self._connect, self.loops), "  </equality>"]
        if self.drivers:
            lines.append("  <actuator>")
            for ref, driver in self.drivers.items():
                pair = f"name={quoteattr(driver)} joint={self._name(ref)}"
                lines.append(f"    <motor {pair}/>")
            lines.append("  </actuator>")
        return "\n".join([*lines, "</mujoco>"]) + "\n"

    def _bodies(self, base: LinkRef, at: complex, depth: int) -> list[str]:
        """The bodies that hang on a link whose body is at a place."""
        lines = []
        for link, (parent, ref) in self.parent.items():
            if parent != base:
                continue
            pin = self.pose.pin(ref)
            properties = self.structure.properties(link)
            numbers = (properties.mass, properties.inertia)
            mass, inertia = (max(float(x), LEAST) for x in numbers)
            c, margin = self.pose.centre(link) - pin, "  " * depth
            # The pair moves the body against its parent; a driver counts as in blockmech.
            sense = 1 if self.structure.later_link(ref) == link else -1
            kind, axis = "hinge", f"0 0 {sense}"
            if ref in self.pose.direction:
                kind, axis = "slide", _xyz(sense * self.pose.direction[ref])
            lines += [
                f'{margin}<body name={self._name(link)} pos="{_xyz(pin - at)}">',
                f'{margin}  <joint name={self._name(ref)} type="{kind}" axis="{axis}"/>',
                f'{margin}  <inertial pos="{_xyz(c)}" mass="{mass!r}"'
                f' diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>',
                *self._bodies(link, pin, depth + 1),
                f"{margin}</body>",
            ]
        return lines

    def _name(self, part: LinkRef | JointRef) -> str:
        """What the document calls a link or a pair, in quotes."""
        if isinstance(part, LinkRef):
            return quoteattr(self.pose.called(part))
        return quoteattr(self.pose.joint_name(part))

    def _connect(self, ref: JointRef) -> str:
        s = self.structure
        first, second = s.earlier_link(ref), s.later_link(ref)
        bodies = [x for x in (first, second) if x != s.frame_link]
        names = " ".join(f"body{k}={self._name(x)}" for k, x in enumerate(bodies, 1))
        base = self.pose.pin(self.parent[bodies[0]][1])
        names = f"name={self._name(ref)} {names}"
        return f'    <connect {names} anchor="{_xyz(self.pose.pin(ref) - base)}"/>'


def _xyz(z: complex) -> str:
    x, y = (float(np.float64(v)) for v in (z.real, z.imag))
    return f"{x!r} {y!r} 0"


WRITER = Writer(
    "MuJoCo: bodies, hinges, slides and loops",
    (".xml", ".mjcf"),
    file_writer(lambda order, stream: stream.write(Model(order).text().encode())),
    {"step": "[s] of its integration; default 1e-4"},
)
