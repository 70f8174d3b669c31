"""Names in a joint-based document that are not there, and what does not fit together."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping
from typing import Any, TypeAlias

from blockmech.errors import Problem, close_match, listed, path_text
from blockmech.model.joints.contents import FRAME
from blockmech.values import NAME_RULE, is_name

Known: TypeAlias = Mapping[str, Collection[str]]
"""Section -> names in it, those of parts that are wrong by themselves included."""


def reference_problems(linkage: Any, known: Known) -> Iterator[Problem]:
    """What links, joints, drivers and loads say of each other that is not so."""
    yield from _links(linkage)
    for name, joint in linkage.joints.items():
        for k, link in enumerate(joint.links):
            yield from _named("link", link, ("joints", name, "links", k), known)
        for link, number in Counter(joint.links).items():
            if number > 1:
                where, found = (
                    path_text(("joints", name, "links")),
                    f"{name} joins {link} to itself",
                )
                yield Problem("wrong-value", where, found, "a joint is between different links")
    yield from _drivers(linkage, known)
    for name, load in linkage.loads.items():
        yield from _load(("loads", name), load, linkage, known)
    for section in ("initial", "stops"):
        for name in getattr(linkage, section):
            yield from _named("driver", name, (section, name), known)


def _named(what: str, name: str, path: tuple[str | int, ...], known: Known) -> Iterator[Problem]:
    """The problem of a name that stands for no link, joint or driver."""
    if name not in known[f"{what}s"] and (what != "link" or name != FRAME):
        names = sorted((*known[f"{what}s"], *([FRAME] if what == "link" else [])))
        found, valid = f'no {what} "{name}"', f"{what}s: {listed(names) or 'none'}"
        remedy = close_match(name, names)
        yield Problem(f"unknown-{what}", path_text(path), found, valid, remedy)


def _links(linkage: Any) -> Iterator[Problem]:
    for name, link in linkage.links.items():
        for marker in link.markers:
            if not is_name(marker):
                where = path_text(("links", name, "markers", marker))
                found = f'"{marker}" is not a marker name'
                yield Problem("bad-name", where, found, NAME_RULE, "choose another name")
        if name != FRAME:
            if link.pose is None:
                found = f'{name} needs "pose": [x, y, angle]'
                valid = "an approximate place [m] and angle [rad] of its frame"
                yield Problem("missing-key", path_text(("links", name, "pose")), found, valid)
            continue
        for key in sorted(link.model_fields_set - {"markers"}):
            where = path_text(("links", FRAME, key))
            found = f"the fixed link has no {key}"
            yield Problem("unknown-key", where, found, "keys there: markers", "remove it")


def _drivers(linkage: Any, known: Known) -> Iterator[Problem]:
    by_joint: dict[str, list[str]] = defaultdict(list)
    for name, driver in linkage.drivers.items():
        by_joint[driver.joint].append(name)
        where = ("drivers", name, "joint")
        yield from _named("joint", driver.joint, where, known)
        yield from _two_links(driver.joint, where, linkage, "drives")
    for joint, names in by_joint.items():
        if len(names) > 1:
            found = f"{listed(names)} all drive {joint}"
            valid, remedy = "a joint has one driver", f"remove {names[1]}"
            yield Problem(
                "conflicting-drivers", path_text(("drivers", names[1])), found, valid, remedy
            )


def _two_links(joint: str, path: tuple[str, ...], linkage: Any, does: str) -> Iterator[Problem]:
    """The problem of a pin of many links where two are meant."""
    links = linkage.joints[joint].links if joint in linkage.joints else ()
    if len(links) > 2:
        found = f"{joint} is a pin of {len(links)} links, and it is not said which two it {does}"
        remedy = "write the pin as joints of two links each"
        yield Problem("wrong-value", path_text(path), found, "", remedy)


def _load(at: tuple[str, str], load: Any, linkage: Any, known: Known) -> Iterator[Problem]:
    if (link := getattr(load, "link", None)) is not None:
        yield from _named("link", link, (*at, "link"), known)
    for k, link in enumerate(getattr(load, "links", None) or ()):
        yield from _named("link", link, (*at, "links", k), known)
    if (joint := getattr(load, "joint", None)) is not None:
        yield from _named("joint", joint, (*at, "joint"), known)
        yield from _two_links(joint, (*at, "joint"), linkage, "acts between")
    if (driver := getattr(load, "driver", None)) is not None:
        yield from _named("driver", driver, (*at, "driver"), known)
