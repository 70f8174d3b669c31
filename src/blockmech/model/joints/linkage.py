"""A mechanism as links and joints. What a file may hold can be said in Python as well."""

from __future__ import annotations

import cmath
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, overload

from blockmech.couplings.contract import Coupling
from blockmech.ground.arguments import declared
from blockmech.ground.errors import (
    GraphError,
    Problem,
    as_names,
    listed,
    path_text,
    refused,
    unknown_name,
)
from blockmech.ground.names import is_name
from blockmech.ground.values import Link, Marker, StrictModel, Vector
from blockmech.loads.contract import Element
from blockmech.model.diagram import Wire
from blockmech.model.document import Document
from blockmech.model.form import Draft, bad_name
from blockmech.model.joints.contents import (
    FRAME,
    LINKAGE_FILE,
    JointGiven,
    LinkGiven,
    no_driver,
    reference_problems,
    sections,
    wire_problems,
)
from blockmech.model.joints.dimensions import Dimension
from blockmech.model.laws_of_motion import LawOfMotion
from blockmech.model.scene import Initial, Role, Scene, Stops
from blockmech.signals.contract import Signal
from blockmech.typing import Arguments, Data, Quantity

if TYPE_CHECKING:
    from blockmech.design.shapes import Body
    from blockmech.friction.laws.contract import FrictionLaw
    from blockmech.ground.values import AnyMarker, AnyPlace, Two


class Linkage(Document):
    """A mechanism as links, joints, drivers and loads, each link with its own frame.

    >>> import blockmech as bm
    >>> m = bm.Linkage("crank_rocker")
    >>> m.add_link("crank", pose=(0, 0, 1.0))
    >>> m.add_link("rod", pose=(0.5, 0.8, 0.3))
    >>> m.add_link("rocker", pose=(2.5, 0, 1.9))
    >>> m.add_joint("A", "R", ["frame", "crank"], at=[(0, 0), (0, 0)])
    >>> m.add_joint("B", "R", ["crank", "rod"], at=[(1, 0), (0, 0)])
    >>> m.add_joint("C", "R", ["rod", "rocker"], at=[(2.5, 0), (2, 0)])
    >>> m.add_joint("D", "R", ["frame", "rocker"], at=[(2.5, 0), (0, 0)])
    >>> m.add_driver("motor", "A", bm.motion.ConstantRate(rate=10.0))
    >>> m
    <Linkage crank_rocker: 3 moving links, 4 pairs, 1 driver; I(crank) -> II RRR(rocker, rod)>
    """

    form = LINKAGE_FILE
    links: dict[str, LinkGiven]
    joints: dict[str, JointGiven]
    drivers: Data
    couplings: dict[str, Coupling]
    loads: Data
    signals: dict[str, Signal]
    dimensions: dict[str, Dimension]
    initial: dict[str, Initial]
    stops: dict[str, Stops]
    motion: dict[str, Role]
    _gravity: Vector

    def __init__(
        self, name: str = "mechanism", *, title: str = "", gravity: complex | Sequence[float] = 0j
    ) -> None:
        super().__init__(name, title=title)
        self.gravity = gravity

    # -- files ------------------------------------------------------------

    def _fill(self, draft: Draft) -> None:
        for section in self.form.items():
            parts = {name: part for name, part in draft.items(section) if part is not None}
            getattr(self, section).update(parts)
        if not draft.doubled:
            draft.note(reference_problems(self, vars(draft.said)))

    @property
    def gravity(self) -> Vector:
        """Gravity [m/s2].

        >>> m.gravity = (0.0, -9.81)
        >>> m.gravity
        0-9.81j
        """
        return self._gravity

    @gravity.setter
    def gravity(self, gravity: complex | Sequence[float] | Vector) -> None:
        """Set gravity [m/s2], (x, y) or x + iy. Raises `GraphError` for what is no vector."""
        made = Scene(gravity=gravity)  # type: ignore[arg-type]
        self.__dict__["_gravity"] = made.gravity

    # -- building ---------------------------------------------------------

    @declared
    def add_link(
        self,
        name: str,
        link: Link | Body | None = None,
        *,
        pose: Sequence[Quantity] | None = None,
        mass: Quantity | None = None,
        inertia: Quantity | None = None,
        cm: AnyPlace | None = None,
        markers: Mapping[str, AnyMarker] | None = None,
    ) -> None:
        """Add a link: ``add_link("rod", bm.Link(mass=2.0), pose=(0.5, 0.8, "20deg"))``.

        The fixed link is there from the start; ``add_link("frame", markers=...)`` gives it
        markers.

        Parameters
        ----------
        link : its mass properties, as a `Link` or of a shape (`bm.design.shapes`), beside keys
        pose : (x, y, angle) [m, m, rad] of the link's own frame; roughly, it fixes the
            assembly mode; default all zero
        mass [kg], inertia [kg m2] about the centre of mass, cm [m] in the link's frame
        markers : name -> place [m], or a `Marker` with a direction

        Raises `GraphError` for a taken name or properties that do not fit, and `RequestError`
        for an object that is no body.

        >>> m.add_link("arm", pose=(0.0, 0.0, "30deg"), mass=2.0, markers={"tip": (0.5, 0.0)})
        >>> m.links["arm"].mass
        2.0
        """
        if not (link is None or isinstance(link, Link) or hasattr(link, "keys")):
            valid = "a bm.Link or a body of bm.design.shapes is meant"
            raise refused("link", f"got {link!r:.60}", valid=valid, code="wrong-type")
        keys = {"pose": pose, "mass": mass, "inertia": inertia, "cm": cm, "markers": markers}
        self._add_model("link", name, link or "", {k: x for k, x in keys.items() if x is not None})

    @declared
    def add_joint(
        self,
        name: str,
        kind: Literal["R", "P", "weld"],
        links: Sequence[str],
        at: Sequence[AnyPlace] | None = None,
        *,
        point: AnyPlace | None = None,
        angle: Quantity | Sequence[Quantity] | None = None,
        dir: Two | Sequence[Two] | None = None,
        slider: Literal[0, 1] | None = None,
        friction: FrictionLaw | None = None,
        clearance: Quantity | None = None,
    ) -> None:
        """Add a joint between two links, or a pin ("R") or weld of more.

        Its position is given in the frames of its links, by ``at``, or in ground axes, by
        ``point``, with the links in their given poses. A link without a pose then gets the zero
        pose, so that its coordinates are those of the drawing.

        Parameters
        ----------
        kind : "R" a pin, "P" a guide, "weld" for links that are one rigid link with the mass of
            all, and keep their names for joints, loads, markers and outputs
        links : names of the links; the coordinate counts from the first to the second, and is 0
            in the given poses for a guide through a ``point``
        at : a place [m] for each link, in its frame
        point : place [m] in the world; the links must be there already
        angle, dir : of a guide or weld, its direction in all frames, or that in the world beside
            ``point``: [rad], or (dx, dy); default along x
        slider : of a guide, which of the two links carries the point where N acts; default 1
        friction : of the joint
        clearance : [m] radial, of a pin

        Raises `GraphError` for what does not fit.

        >>> arm = bm.Linkage("arm")
        >>> arm.add_link("arm")
        >>> arm.add_joint("O", "R", ["frame", "arm"], point=(0.0, 0.0))
        >>> arm.add_link("sleeve")
        >>> arm.add_joint("S", "P", ["arm", "sleeve"], point=("50cm", 0.0), angle="0deg")
        >>> arm.joints["S"].at
        [0.5+0j, 0.5+0j]
        """
        links = list(as_names(f"joints.{name}.links", links))
        alone = isinstance(at, list | tuple) and all(isinstance(x, float | int | str) for x in at)
        if alone or (at is None) == (point is None):
            message = "its place is given twice" if point is not None else "it has no place"
            message = "at= has a place for each link" if alone else message
            remedy = (
                "give at=, a place in the frame of each link, or point=, the place in the world"
            )
            raise GraphError(Problem("wrong-value", f"joints.{name}", message, "", remedy))
        keys = {"type": kind, "links": links, "at": at, "angle": angle, "dir": dir}
        laws = {"slider": slider, "friction": friction, "clearance": clearance}
        if point is None:
            self._add("joint", name, keys | laws, kind)
            return
        posed_links = self._as_drawn(name, links)
        direction: Arguments = {} if kind == "R" else {"angle": angle, "dir": dir}
        marker = Marker(at=point, **direction)
        keys["at"] = [(marker.at.z - link.at[0]) * _turn_back(link) for link in posed_links]
        if kind != "R" and (kind == "P" or any(link.at[1] for link in posed_links)):
            directions = [marker.direction * _turn_back(link) for link in posed_links]
            keys |= {"angle": None, "dir": directions}
        self._add("joint", name, keys | laws, kind)
        self.links.update(
            (x, posed) for x, posed in zip(links, posed_links, strict=True) if x != FRAME
        )

    def _as_drawn(self, name: str, links: Sequence[str]) -> list[LinkGiven]:
        """Links of a joint in the poses of the drawing, zero where none was given."""
        missing = [link for link in links if link not in self.links and link != FRAME]
        if missing:
            where, first = f"joints.{name}.links", "add it first: its pose counts"
            raise GraphError(
                unknown_name("unknown-link", "link", missing[0], where, [FRAME, *self.links], first)
            )
        by_name, zero = {FRAME: LinkGiven()} | self.links, {"pose": (0.0, 0.0, 0.0)}
        posed_links = (by_name[link] for link in links)
        return [link if link.pose else link.model_copy(update=zero) for link in posed_links]

    @declared
    def add_driver(
        self, name: str, joint: str, law: LawOfMotion | str | None = None, **keys: Any
    ) -> None:
        """Drive the coordinate of a joint, by a law of motion if one is given.

        The coordinate is the angle [rad] of the second link less that of the first (R), or
        the distance [m] from the first link's point to the second's along the guide (P).

        Parameters
        ----------
        law : the law, or its kind, such as "constant_rate", whose keys then follow

        Raises `GraphError` for a taken name, an unknown kind or keys that do not fit.

        >>> arm = bm.Linkage("arm")
        >>> arm.add_link("arm")
        >>> arm.add_joint("O", "R", ["frame", "arm"], point=(0.0, 0.0))
        >>> arm.add_driver("motor", "O", "constant_rate", rate="300rpm")
        >>> arm
        <Linkage arm: 1 moving links, 1 pairs, 1 driver; I(arm)>
        """
        self._add_model("driver", name, law or "", {"joint": joint, **keys})

    @overload
    def add_load(
        self,
        name: str,
        load: Element,
        *,
        link: str | None = None,
        links: Sequence[str] | None = None,
        joint: str | None = None,
        at: AnyPlace | Sequence[AnyPlace] | None = None,
    ) -> None: ...

    @overload
    def add_load(self, name: str, load: str, **keys: Any) -> None: ...

    @declared
    def add_load(self, name: str, load: Element | str, **keys: Any) -> None:
        """Add a load: ``add_load("wind", bm.Force(force=(30.0, 0.0)), link="rod", at=(1.0, 0.0))``.

        Parameters
        ----------
        load : the load as a block, or its kind, such as "force", whose keys then follow
        link, links : the link or links on which it acts
        joint : in place of ``links`` and ``at``, for a couple between the two links of a pin, or a
            motor, spring, damper or thrust along a guide, by its coordinate
        at : place [m] on the link, or on each of them, in their frames

        Raises `GraphError` for an unknown kind or keys that do not fit.

        >>> m.add_load("wind", bm.Force(force=(30.0, 0.0)), link="rod", at=(0.1, 0.0))
        >>> m.add_load("brake", "motor", joint="O", law={"kind": "constant", "value": -2.0})
        >>> list(m.loads)
        ['gas', 'wind', 'brake']
        """
        self._add_model("load", name, load, keys)

    @declared
    def add_coupling(self, name: str, coupling: Coupling | str, **keys: Any) -> None:
        """Let one driver follow another: ``add_coupling("mesh", Gear(driver="a", ...))``.

        The driven one has no law of motion. A wheel or cam that is fixed to a link is named by the
        address ``"link.marker"`` of its centre.

        Parameters
        ----------
        coupling : the coupling, or its kind, such as "gear", whose keys then follow

        Raises `GraphError` for a taken name, an unknown kind or keys that do not fit.

        >>> m.add_link("wheel", pose=(0.2, 0.0, 0.0))
        >>> m.add_joint("P", "R", ["frame", "wheel"], point=(0.2, 0.0))
        >>> m.add_driver("shaft", "P")
        >>> m.add_coupling("mesh", "gear", driver="motor", driven="shaft", teeth=[20, 40])
        >>> m
        <Linkage slider_crank: 4 moving links, 5 pairs, 2 drivers; I(crank) -> I(wheel) -> ...
        """
        self._add_model("coupling", name, coupling, keys)

    @declared
    def add_signal(self, name: str, signal: Signal | str, **keys: Any) -> None:
        """Add a signal block: ``add_signal("error", signals.Sum(signs="+-"))``.

        Parameters
        ----------
        signal : the signal block, or its kind, such as "sum", whose keys then follow

        Raises `GraphError` for a taken name, or a block that a file cannot hold.

        >>> m.add_signal("error", bm.signals.Sum(signs="+-"))
        >>> m.add_signal("gain", "gain", k=2.0)
        """
        self._add_model("signal", name, signal, keys)

    @declared
    def add_dimension(
        self,
        name: str,
        kind: Literal[
            "length",
            "angle",
            "parallel",
            "perpendicular",
            "equal",
            "in_line",
            "on_circle",
            "position",
        ],
        points: Sequence[str],
        value: Quantity | AnyPlace | None = None,
    ) -> None:
        """Add a dimension to the drawing; compiling moves its points to satisfy all of them.

        Parameters
        ----------
        kind : "length" of AB [m]; "angle" [rad] from BA to BC, or of AB from the x axis;
            "parallel", "perpendicular", "equal" (in length) of AB and CD; "in_line" of three
            points or more; "on_circle" about the first point; "position" of a point [m]
        points : joints by name, markers as ``"link.marker"``
        value : of a length, angle or position, also as text with a unit. It is a parameter of the
            design, ``"dimensions.rod.value"``

        Raises `GraphError` for a taken name, or points and values that do not fit.

        >>> m.add_dimension("rod", "length", ["A", "B"], "250mm")
        >>> print(m.fit_dimensions())
        dimensions satisfied: 1; A moved most, by 0.0253 m
        degrees of freedom left: 3, of A, B
        """
        points = list(as_names(f"dimensions.{name}.points", points))
        self._add("dimension", name, {"type": kind, "points": points, "value": value}, kind)

    @declared
    def connect(self, source: str, target: str) -> None:
        """Wire a signal: ``connect("driver.shaft.rate", "error.u1")``.

        Parameters
        ----------
        source : an output ``"signal.output"`` of a signal block, or any output of the mechanism
            that is one number, by its name
        target : an input ``"signal.input"``, or ``"load.law"`` of a load whose law is a signal

        Raises `GraphError` for invalid names; compiling checks that the output exists.

        >>> m.add_signal("gain", "gain", k=2.0)
        >>> m.connect("driver.motor.rate", "gain.u")
        """
        wire = Wire(source, target)
        GraphError.raise_for(wire_problems(self, wire, self.wires))
        self.wires.append(wire)

    @declared
    def _give(self, section: str, driver: str, item: Any) -> None:
        if driver in self.joints and driver not in self.drivers:
            raise GraphError(no_driver(self, (section, driver), self.drivers))
        getattr(self, section)[driver] = item

    def _add_model(
        self, section: str, name: str, model: StrictModel | Body | str, keys: Arguments
    ) -> None:
        """Add an item by an object, or by its kind; keys come on top of what the object says."""
        if isinstance(model, StrictModel):
            fields = {key: getattr(model, key) for key in model.model_fields_set}
            kind = sections()[f"{section}s"].word(model)
            self._add(section, name, fields | keys, kind).keep_texts(model, keys)
        elif isinstance(model, str):
            self._add(section, name, keys, model)
        else:
            self._add(section, name, {**model, **keys})

    def _add(
        self, kind_of_item: str, name: str, arguments: Arguments, kind: str = ""
    ) -> StrictModel:
        """Add an item of a kind. Raises `GraphError` with places in the document."""
        if not isinstance(name, str) or not is_name(name):
            raise GraphError(bad_name(kind_of_item, name))
        section = sections()[f"{kind_of_item}s"]
        items = getattr(self, f"{kind_of_item}s")
        where = f"{kind_of_item}s.{name}"
        if name in items:
            message, valid = f"there is a {kind_of_item} of that name", f"taken: {listed(items)}"
            raise GraphError(Problem("taken-name", where, message, valid, "choose another name"))
        model = section.kinds.get(kind) if kind else section.plain
        if model is None:
            raise GraphError(section.unknown_kind(kind, f"{where}.{section.key}"))
        try:
            in_file = {key: field.alias or key for key, field in model.model_fields.items()}
            keys = {in_file.get(key, key): x for key, x in arguments.items() if x is not None}
            item: StrictModel = model(**keys)
        except GraphError as error:
            path, cls = path_text((f"{kind_of_item}s", name)), model.__name__
            problems = [
                replace(p, where=p.where.replace(cls, path, 1), found=p.found.replace(cls, path, 1))
                for p in error.problems
            ]
            if section.key and not kind:  # its keys are those of a kind that was not named
                remedy = f"name its {section.key} first: {listed(section.kinds)}"
                problems = [replace(p, remedy=remedy) for p in problems]
            raise GraphError(problems) from None
        items[name] = item
        return item

    @property
    def driven(self) -> dict[str, str]:
        """Driven joint -> the driver's name.

        >>> m.driven
        {'O': 'motor'}
        """
        return {driver.joint: name for name, driver in self.drivers.items()}


def _turn_back(link: LinkGiven) -> complex:
    """What turns a direction in the world into the link's axes."""
    return cmath.rect(1.0, -link.at[1])
