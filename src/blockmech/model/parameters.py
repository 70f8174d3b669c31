"""Every number of a design has an address: ``dyad.l_i``, ``frame.D.x``, ``gas.law.values[3]``.

Addresses are those of the file, from the item on: keys with dots, places of a list in
brackets, the parts of a place or vector as ``.x`` and ``.y``. A marker is called as in wires,
``block.marker``. They are found by walking the declared models; no list of them exists.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from blockmech.blocks.contract import Moving
from blockmech.ground.errors import (
    Problem,
    RequestError,
    as_names,
    close_match,
    listed,
    path_text,
)
from blockmech.ground.plane import apply
from blockmech.ground.texts import unit_of
from blockmech.ground.units import NoQuantity, quantity
from blockmech.ground.validation_errors import field_order
from blockmech.ground.values import Axis, Marker, Pair, StrictModel
from blockmech.model.scene import Scene
from blockmech.model.subgraph import Subgraph
from blockmech.typing import Record

Path = tuple[str | int, ...]
BLOCKS = "blocks"  # the section whose items an address names without it
ALONE = (BLOCKS, "loads", "couplings", "signals")  # those whose outputs bear its name alone
FIXED_LINK = ("links", "frame")
PARTS = ("x", "y")  # of a place or vector
T = TypeVar("T")
OF_LINKS = {
    "length": 'a length between pins is a number by add_dimension("rod", "length", ["A", "B"])',
    "point": "its place on the first link is {0}.at[0], on the second {0}.at[1]: the "
    "pin moves with both",
    "friction": "the joint has no friction law with that number: give it one, e.g. "
    'replace({{"{0}.friction": bm.friction.Coulomb(coefficient=0.1, radius="10mm")}})',
}
"""Words of addresses that are no numbers among links and joints -> what is there in their place."""


class Parameter(NamedTuple):
    """A number of a design.

    Attributes
    ----------
    address : parameter path value : number in ``unit`` unit : SI, ``""`` for a ratio, a direction
    or a choice
    path : keys of the file that lead to it, with "x" and "y" for the parts of a vector
    """

    address: str
    value: float
    unit: str
    path: Path


def parameters_of(sections: Record) -> dict[str, Parameter]:
    """All numbers of a design by address, in the order of the file.

    ``sections`` are those of the document: named items, or models.
    """
    parameters: dict[str, Parameter] = {}
    axes = dict(_axes(sections))
    for section, content in sections.items():
        named = isinstance(content, Mapping)
        for key, item in content.items() if named else [("", content)]:
            path: Path = (section, key) if named else (section,)
            head = path_text(path[1:] if section == BLOCKS else path)
            unit = unit_of(Scene.model_fields.get(section))
            axis = axes.get(key, Axis())._replace(known=axes)
            if isinstance(item, Subgraph):
                parameters |= {p.address: p for p in _of_graph(item, path, head)}
                continue
            for parameter in _numbers(item, path, head, head, unit, axis):
                if path != FIXED_LINK or parameter.path[2] == "markers":  # it has no mass
                    parameters.setdefault(parameter.address, parameter)
    return parameters


def interface(graph: Any) -> dict[str, tuple[Parameter, tuple[Path, ...]]]:
    """What can be set of a graph from outside: its named parameters, then its other numbers.

    Each with the places of the numbers that it stands for.

    Raises `RequestError` for named parameters that stand for nothing, or for what differs.
    """
    numbers = parameters_of(graph.sections())
    named_parameters: dict[str, tuple[Parameter, tuple[Path, ...]]] = {}
    problems: list[Problem] = []
    for name, addresses in graph.parameters.items():
        try:
            numbers_of_name = list(named(numbers, dict.fromkeys(as_names(name, addresses))))
        except RequestError as error:
            problems += [replace(p, where=f"parameters.{name}") for p in error.problems]
            continue
        if len({(p.value, p.unit) for p in numbers_of_name}) > 1:
            values = ", ".join(
                f"{p.address} = {p.value:g} {p.unit}".rstrip() for p in numbers_of_name
            )
            valid = "a parameter stands for numbers of one value and unit"
            problems.append(Problem("wrong-value", f"parameters.{name}", values, valid))
        first, paths = numbers_of_name[0], tuple(p.path for p in numbers_of_name)
        named_parameters[name] = first._replace(address=name, path=("parameters", name)), paths
    RequestError.raise_for(problems)
    used = {path for _, paths in named_parameters.values() for path in paths}
    used |= {p.path for p in numbers.values() if p.path[:2] == ("scene", "gravity")}  # of all
    return named_parameters | {a: (p, (p.path,)) for a, p in numbers.items() if p.path not in used}


def _of_graph(block: Subgraph, path: Path, head: str) -> Iterator[Parameter]:
    """The numbers of a graph inside of another one, which its block can set."""
    for address, (p, _) in interface(block.content).items() if block.content else ():
        value = block.given.get(address, p.value)
        yield Parameter(f"{head}.{address}", value, p.unit, (*path, "parameters", address))


def _axes(sections: Record) -> Iterator[tuple[str, Axis]]:
    """Drivers by name, and joints of a document, each with the units along its coordinate."""
    for name, block in sections.get(BLOCKS, {}).items():
        for joint in block.driven if isinstance(block, Moving) else ():
            yield block.driver_name(name, joint.name), Axis.of(joint.kind)
        for joint in block.joints.values() if isinstance(block, Moving) else ():
            yield f"{name}.{joint.name}.coordinate", Axis.of(joint.kind)
        if isinstance(block, Subgraph) and block.content:
            yield from ((f"{name}.{d}", axis) for d, axis in _axes(block.content.sections()))
    joints = {name: Axis.of(joint.type) for name, joint in sections.get("joints", {}).items()}
    for name, driver in sections.get("drivers", {}).items():
        yield name, joints.get(driver.joint, Axis())
    for name, axis in joints.items():
        yield from ((text, axis) for text in (f"joint.{name}", f"joint.{name}.coordinate"))


def _numbers(
    x: Any, path: Path, text: str, item: str, unit: Any, outside: Axis
) -> Iterator[Parameter]:
    """The numbers in a value at a path, called ``text``, of an item of the document.

    ``unit`` is one for all of them, or one for each place or name in the value.
    """
    if isinstance(x, StrictModel):
        axis = x.axis(outside)
        units = x.units(axis)
        for name in field_order(type(x)):
            field = type(x).model_fields[name]
            key = field.alias or name
            inner = f"{text}.{key}"
            if name == "markers":
                inner = item
            elif isinstance(x, Marker) and name == "at":
                inner = text
            unit_inside = units.get(name) or unit_of(field)
            yield from _numbers(getattr(x, name), (*path, key), inner, item, unit_inside, axis)
    elif isinstance(x, Mapping):
        for key, value in x.items():
            unit_inside = unit.get(key, "") if isinstance(unit, Mapping) else unit
            axis = outside.known.get(key, outside)._replace(known=outside.known)
            yield from _numbers(value, (*path, key), f"{text}.{key}", item, unit_inside, axis)
    elif isinstance(x, list | tuple):
        for k, value in enumerate(x):
            unit_inside = unit if isinstance(unit, str) else unit[k]
            yield from _numbers(value, (*path, k), f"{text}[{k}]", item, unit_inside, outside)
    elif isinstance(x, Pair):
        for part, value in zip(PARTS, (x.z.real, x.z.imag), strict=True):
            yield Parameter(f"{text}.{part}", value, unit or x.unit, (*path, part))
    elif isinstance(x, int | float) and not isinstance(x, bool):
        yield Parameter(text, x, unit, path)


def wrong_units(sections: Record) -> Iterator[Problem]:
    """Numbers that were written with a unit of another kind than they are."""
    units = {p.path: p for p in parameters_of(sections).values()} if StrictModel.spoken else {}
    for path, text in _texts(sections, ()) if units else ():
        if (p := units.get(path)) is not None:
            try:
                quantity(text, p.unit)
            except NoQuantity as error:
                yield Problem("wrong-unit", p.address, error.found, error.valid)


def _texts(x: Any, path: Path) -> Iterator[tuple[Path, str]]:
    """The numbers in a value that were written as texts, each with its path."""
    if isinstance(x, StrictModel):
        yield from (((*path, *keys), text) for keys, text in vars(x).get("texts", {}).items())
        x = {key: getattr(x, name) for key, name in _names(x).items()}
    items = x.items() if isinstance(x, Mapping) else enumerate(x) if type(x) is list else ()
    for key, item in items:
        yield from _texts(item, (*path, key))


def named(numbers: Mapping[str, Parameter], requested: Mapping[str, T]) -> dict[Parameter, T]:
    """The parameters that addresses name, as they are listed or as the file has them.

    Raises `RequestError` for addresses of nothing, all at once.
    """
    as_written: dict[str, Parameter] = {}
    if not numbers.keys() >= requested.keys():
        for p in numbers.values():
            as_written |= dict.fromkeys(_spellings(p.path), p)
    values: dict[Parameter, T] = {}
    problems = []
    parameter: Parameter | None
    for address, x in requested.items():
        parameter = numbers[address] if address in numbers else as_written.get(address)
        if parameter is None:
            problems.append(_unknown(address, numbers))
        elif parameter in values:
            message = f"{parameter.address} is given twice"
            problems.append(Problem("taken-name", address, message, "", "give it once"))
        else:
            values[parameter] = x
    RequestError.raise_for(problems)
    return values


def _spellings(path: Path) -> Iterator[str]:
    """How a file or its messages would say where a number is."""
    ends = [path]
    if path[-1] in PARTS:
        ends.append((*path[:-1], PARTS.index(str(path[-1]))))
    for end in ends:
        yield path_text(end)
        yield path_text((str(end[0]).removesuffix("s"), *end[1:]))
        if end[0] in ALONE:
            yield path_text(end[1:])


def _unknown(address: object, numbers: Mapping[str, Parameter]) -> Problem:
    """The problem of an address of nothing: what is nearest to it, and how to come by such one."""
    message, text = "the mechanism has no parameter with that address", str(address)
    owners = itertools.accumulate(text.split("."), "{}.{}".format)
    siblings = [[a for a in numbers if a.startswith((f"{x}.", f"{x}["))] for x in owners]
    neighbours = next(filter(None, reversed(siblings)), numbers)
    valid = f"addresses there: {listed(neighbours, 16)}"
    remedy = close_match(text, list(numbers))
    if any(a.startswith("joints.") for a in numbers) and "dimensions" not in remedy:
        for word, hint in OF_LINKS.items():
            owner, match, _ = f"{text}.".partition(f".{word}.")
            if match and not any(a.startswith(f"{owner}.{word}") for a in numbers):
                remedy = hint.format(owner)
    return Problem("unknown-parameter", text, message, valid, remedy)


def number_at(data: Any, path: Path) -> Any:
    """The number at a path of what a file holds; None where it says nothing there."""
    for key in path:
        index = PARTS.index(str(key)) if isinstance(data, list) and key in PARTS else key
        try:
            data = data[index]
        except (KeyError, IndexError):
            return None
    return data


def value_at(x: Any, path: Path) -> Any:
    """The number at a path inside of a value, as `parameters_of` finds it."""
    for key in path:
        if isinstance(x, Pair):
            x = getattr(x.z, ("real", "imag")[PARTS.index(str(key))])
        else:
            x = getattr(x, _names(x)[key]) if isinstance(x, StrictModel) else x[key]
    return x


def _names(x: StrictModel) -> dict[str | int, str]:
    """Key of the file -> name of a model's field."""
    return {field.alias or name: name for name, field in type(x).model_fields.items()}


def replaced(x: Any, values: Mapping[Path, Any]) -> Any:
    """A value with other numbers at paths inside it, unchecked: of any type with arithmetic."""
    if () in values:
        return values[()]
    inside: dict[str | int, dict[Path, Any]] = {}
    for path, value in values.items():
        inside.setdefault(path[0], {})[path[1:]] = value
    if isinstance(x, StrictModel):
        names = _names(x)
        update = {names[k]: replaced(getattr(x, names[k]), v) for k, v in inside.items()}
        return x.model_copy(update=update)
    if isinstance(x, Mapping):
        return {**x, **{key: replaced(x.get(key), v) for key, v in inside.items()}}
    if isinstance(x, Pair):
        parts = zip(PARTS, (x.z.real, x.z.imag), strict=True)
        z = apply(
            "planar",
            *(inside[part][()] if part in inside else component for part, component in parts),
        )
        return type(x)(z)
    items = [replaced(item, inside[k]) if k in inside else item for k, item in enumerate(x)]
    return type(x)(items)
