"""A mechanism as a document: named, loaded, saved and changed from outside."""

from __future__ import annotations

import copy
import functools
import inspect
import os
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ClassVar, Self, TypeAlias, TypeVar

from blockmech.ground.arguments import declared
from blockmech.ground.errors import (
    FormatError,
    GraphError,
    Problem,
    RequestError,
    close_match,
    in_file,
    listed,
    unknown_name,
)
from blockmech.ground.memory import uncollected
from blockmech.ground.units import number_in_si
from blockmech.ground.values import StrictModel
from blockmech.model.diagram import Wire
from blockmech.model.form import EXTRAS, Draft, Form, canonical_text, plain
from blockmech.model.parameters import PARTS, Path, named, parameters_of, replaced
from blockmech.model.reading import data_of, text_of
from blockmech.model.scene import Initial, Locked, Stops
from blockmech.model.versions import current
from blockmech.typing import Data, Quantity, Record

Part: TypeAlias = StrictModel | Record | Sequence[Quantity] | None
"""What can stand in a document in place of a number: a model, its data, a vector, nothing."""


class Document:
    """A mechanism that can be loaded, saved and changed; the base of `Graph` and `Linkage`.

    Attributes that can be set are declared in the class body or are properties; a misspelt
    one (``graph.gravty = ...``) is refused, so that it is not lost.
    """

    name: str
    title: str
    extras: Data  # view, expect, source, notes: kept with the file
    file: str  # where the document was read from, for messages
    wires: list[Wire]

    form: ClassVar[Form]

    @declared
    def __init__(self, name: str = "mechanism", *, title: str = "") -> None:
        self.name, self.title, self.file, self.extras = name, title, "", {}
        for section, field in self.form.sections.items():
            setattr(self, section, {} if field.is_required() else copy.copy(field.default))

    # -- files ------------------------------------------------------------

    @classmethod
    @declared
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a file.

        Raises
        ------
        FormatError with all problems of the file
        GraphError if only the wiring of a graph is wrong

        >>> bm.Graph.load("graphs/ruiz_fourbar.json")
        <Graph ruiz_fourbar: 3 moving links, 4 pairs, mobility 1; I(crank: 0,1) -> II ...
        """
        return cls.from_json(text_of(path), os.fspath(path))

    @classmethod
    @declared
    def from_json(cls, text: str, file: str = "") -> Self:
        """Read the text of a file; ``file`` is its name in messages. Raises like `load`.

        >>> bm.Graph.from_json(g.to_json())
        <Graph ruiz_fourbar: 3 moving links, 4 pairs, mobility 1; I(crank: 0,1) -> II ...
        """
        return read(text, file, lambda raw: cls)

    @classmethod
    @uncollected()
    @declared
    def from_data(cls, data: Data, odd: Iterable[Problem] = (), file: str = "") -> Self:
        """Build a document from the content of a file. Raises like `load`.

        >>> bm.Graph.from_data(g.to_data())
        <Graph ruiz_fourbar: 3 moving links, 4 pairs, mobility 1; I(crank: 0,1) -> II ...
        """
        draft = Draft(cls.form, current(data), list(odd))
        content: Any = draft.said
        document, keys = cls(content.name, title=content.title), content.model_fields_set
        document.extras.update({key: getattr(content, key) for key in EXTRAS if key in keys})
        document.file = file
        for section in cls.form.sections.keys() - cls.form.items().keys() - {"wires"}:
            x = getattr(content, section)
            setattr(document, section, dict(x) if isinstance(x, Mapping) else x)
        document.wires += [Wire(wire.source, wire.target) for wire in content.wires]
        document._fill(draft)
        draft.finish()
        return document

    @declared
    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the canonical file, whole or not at all.

        Raises
        ------
        FormatError, GraphError for a document that could not be read back; nothing is written
        RequestError if the path cannot be written

        >>> g.save("fourbar.json")
        >>> bm.read("fourbar.json").name
        'ruiz_fourbar'
        """
        from blockmech.ground.files import cannot_write, writing

        where = os.fspath(path)
        if os.path.splitext(where)[1].lower() not in ("", ".json"):
            message = "a mechanism is saved as JSON"
            raise cannot_write(where, message, "name it .json, or use blockmech.write")
        text = self.in_folder(os.path.dirname(where)).to_json()
        self.from_data(*data_of(text), where)  # what a file does not hold is not written
        with writing(path) as stream:
            stream.write(text.encode())

    def in_folder(self, folder: str) -> Self:
        """The document for another folder, with rewritten paths to other files.

        >>> g.in_folder("elsewhere")
        <Graph ruiz_fourbar: 3 moving links, 4 pairs, mobility 1; I(crank: 0,1) -> II ...
        """
        return self

    def to_json(self) -> str:
        """The canonical text of the file. Raises `FormatError` for values that JSON lacks.

        >>> g.to_json().splitlines()[1].strip()
        '"format": "blockmech/graph",'
        """
        return canonical_text(self.to_data())

    def to_data(self) -> Data:
        """The content of the file.

        >>> list(g.to_data())[:3]
        ['format', 'version', 'name']
        """
        return self._written(self.sections())

    def _written(self, sections: Record) -> Data:
        extras = {key: self.extras.get(key) for key in EXTRAS}
        return self.form.written({**sections, **extras, "name": self.name, "title": self.title})

    # -- free motions -----------------------------------------------------

    @declared
    def start(self, driver: str, q: Quantity = 0.0, rate: Quantity = 0.0) -> None:
        """Give a driver its start for free motion: q [rad or m], rate [rad/s or m/s].

        >>> g.start("crank", q="30deg", rate=5.0)
        >>> round(g.scene.initial["crank"].q, 6)
        0.523599
        """
        self._give("initial", driver, Initial(q=q, rate=rate))

    @declared
    def add_stop(
        self,
        driver: str,
        low: Quantity | None = None,
        high: Quantity | None = None,
        restitution: float | None = None,
    ) -> None:
        """Give a driver end stops for free motion: lowest and highest coordinate [rad or m].

        Any pair may have stops on its coordinate: ``"rod.S.coordinate"`` of a slider in a graph,
        ``"joint.S.coordinate"`` of a joint between links.

        With a restitution, from 0 to 1, the driver rebounds; without one the motion ends at the
        stop.

        Raises `GraphError` where neither is given or they are in the wrong order.

        >>> g.add_stop("crank", "-30deg", "80deg", restitution=0.5)
        >>> round(g.scene.stops["crank"].low, 6)
        -0.523599
        """
        keys: Data = {"from": low, "to": high, "restitution": restitution}
        self._give("stops", driver, Stops(**keys))

    @declared
    def prescribe(self, driver: str) -> None:
        """Let a driver follow its law of motion in motions of the others.

        >>> g.prescribe("crank")
        >>> g.scene.motion
        {'crank': 'prescribed'}
        """
        self._give("motion", driver, "prescribed")

    @declared
    def lock(self, driver: str, q: Quantity | None = None) -> None:
        """Lock a driver in motions of the others: at q [rad or m], or where it starts.

        >>> g.lock("crank", "30deg")
        >>> g.scene.motion
        {'crank': Locked(locked=0.5235987755982988)}
        """
        self._give("motion", driver, "locked" if q is None else Locked(locked=q))

    @abstractmethod
    def _give(self, section: str, driver: str, item: Any) -> None:
        """Say something of a driver."""

    # -- designs ----------------------------------------------------------

    @declared
    def replace(self, values: Mapping[str, Quantity | Part]) -> Self:
        """The same mechanism with other numbers or parts, checked like a file.

        ``values`` is address -> number, e.g. ``{"dyad.l_i": 6.1, "frame.D.x": 5.0}``; see
        `blockmech.model.parameters`. Vectors, lists and parts are named as in the file, and None
        takes a part out: ``{"loads.gas.force": (-1000, 0), "loads.wind": None}``,
        ``{"joints.A.friction": bm.friction.Coulomb(coefficient=0.1, radius=0.01)}``. The
        ``expect`` of the file is dropped, as it holds for the old mechanism.

        Raises
        ------
        RequestError for unknown addresses
        FormatError, GraphError for numbers and parts that do not fit

        >>> g.replace({"dyad.l_i": 6.1}).blocks["dyad"].l_i
        6.1
        >>> g.replace({"dyad.friction": {}}).blocks["dyad"].friction
        {}
        """
        known, kinds = parameters_of(self.sections()), Mapping | StrictModel | list | tuple | None
        parts = {a: x for a, x in values.items() if a not in known and isinstance(x, kinds)}
        new: Data = {a: x for a, x in values.items() if a not in parts}
        numbers = named(known, new)
        texts = {p: x for p, x in numbers.items() if isinstance(x, str) and p.path[-1] in PARTS}
        in_si = {p: number_in_si(x, p.unit) for p, x in texts.items()}
        return self._fitted().with_checked({p.path: x for p, x in (numbers | in_si).items()}, parts)

    def _fitted(self) -> Self:
        """The document whose numbers are those of its mechanism."""
        return self

    def with_checked(self, numbers: Mapping[Path, float], parts: Record | None = None) -> Self:
        """A copy with other numbers at some paths, checked like a file; see `replace`.

        >>> g.with_checked({("blocks", "dyad", "l_i"): 6.1}).blocks["dyad"].l_i
        6.1
        """
        items = {
            path: x.item() if getattr(x, "ndim", 1) == 0 and hasattr(x, "item") else x
            for path, x in numbers.items()
        }
        data = self._written(replaced(self.sections(), items))
        data.pop("expect", None)
        for address, part in (parts or {}).items():
            self._put(data, address, part)
        return self.from_data(data, (), self.file)

    def _put(self, data: Data, address: str, part: Part) -> None:
        """Put a part into what a file holds, or take it out where it is None."""
        *path, key = address.split(".")
        sections = self.form.items()
        if path and f"{path[0]}s" in sections:
            path[0] += "s"
        elif (path or [key])[0] in data.get("blocks", ()):
            path.insert(0, "blocks")
        if path and path[0] in sections:
            data.setdefault(path[0], {})
        owner: Any = data
        for n, name in enumerate((*path, key)):
            keys = owner if isinstance(owner, dict) else {}
            is_missing = name not in keys and (n < len(path) or part is None)
            if is_missing or not path:
                where, *names = (".".join((*path[:n], x)) for x in (name, *keys))
                raise RequestError(unknown_name("unknown-parameter", "part", where, address, names))
            owner = keys[name] if n < len(path) else keys
        if part is None:
            del owner[key]
        else:
            items = sections.get(path[0]) if len(path) == 1 else None
            owner[key] = items.data(part) if items else plain(part)

    def with_numbers(self, numbers: Mapping[Path, Any]) -> Self:
        """An unchecked copy with other numbers at some paths, of any type with arithmetic.

        >>> g.with_numbers({("blocks", "dyad", "l_i"): 6.1}).blocks["dyad"].l_i
        6.1
        """
        copied = copy.copy(self)
        sections = replaced(self.sections(), numbers)
        for section in {str(path[0]) for path in numbers}:
            setattr(copied, section, sections[section])
        return copied

    def snapshot(self) -> Self:
        """A copy that does not change with this document.

        >>> copy = g.snapshot()
        >>> g.gravity = (0.0, -9.81)
        >>> copy.gravity
        0+0j
        """
        copied = copy.copy(self)
        for name, x in vars(self).items():
            vars(copied)[name] = copy.copy(x) if isinstance(x, dict | list) else x
        return copied

    def sections(self) -> Data:
        """The sections of the file between head and extras, as models.

        >>> list(g.sections())
        ['blocks', 'wires', 'scene', 'parameters']
        """
        return {section: getattr(self, section) for section in self.form.sections}

    @abstractmethod
    def _fill(self, draft: Draft) -> None:
        """Take what a file says; what is wrong is noted in the draft."""

    # -- attributes -------------------------------------------------------

    def __setattr__(self, name: str, value: object) -> None:
        cls: Any = type(self)
        names = _attributes(cls)
        if name not in names:
            raise GraphError(_unknown_attribute(cls, name, names))
        super().__setattr__(name, value)


D = TypeVar("D", bound=Document)


def read(text: str, file: str, kind: Callable[[Data], type[D]]) -> D:
    """The document in a text, whose data tell its kind. Raises like `Document.load`."""
    try:
        raw, odd = data_of(text)
        return kind(raw).from_data(raw, odd, file)
    except (FormatError, GraphError) as error:
        raise type(error)(in_file(error.problems, file)) from error.__cause__


@functools.cache
def _attributes(cls: type) -> tuple[str, ...]:
    """Names that can be set on documents of a kind."""
    declared = [n for c in cls.__mro__ for n in vars(c).get("__annotations__", ())]
    members = inspect.getmembers_static(cls)  # nothing is loaded for methods that are not called
    properties = [n for n, p in members if isinstance(p, property) and p.fset]
    return *(n for n in declared if not n.startswith("_") and n != "form"), *properties


def _unknown_attribute(cls: type, name: str, names: tuple[str, ...]) -> Problem:
    """The problem of an attribute that cannot be set."""
    methods = [n for n, m in inspect.getmembers(cls, callable) if not n.startswith("_")]
    message = f'there is no attribute "{name}" to set'
    if name in methods:
        message = f"{name}() is called, not set"
    elif hasattr(cls, name):
        message = f"{name} follows from the rest, and is not set"
    remedy = "" if hasattr(cls, name) else close_match(name, [*names, *methods])
    valid = f"attributes: {listed(sorted(names), len(names))}"
    return Problem("unknown-attribute", f"{cls.__name__}.{name}", message, valid, remedy)
