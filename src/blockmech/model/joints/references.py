"""Names in a joint-based document that are not there, and what does not fit together."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from blockmech.errors import Problem, close_match, listed
from blockmech.model.joints.contents import FRAME, Section
from blockmech.model.problems import path_text
from blockmech.values import NAME_RULE, is_name, shown

if TYPE_CHECKING:
    from blockmech.model.joints.linkage import Linkage


@dataclass(frozen=True)
class Known:
    """Names that a document gives, those of parts that are wrong by themselves included."""

    links: set[str]
    joints: set[str]
    drivers: set[str]

    @classmethod
    def of(cls, linkage: Linkage) -> Known:
        """All names of a document."""
        return cls(set(linkage.links), set(linkage.joints), set(linkage.drivers))


def reference_problems(linkage: Linkage, known: Known) -> Iterator[Problem]:
    """What links, joints, drivers and loads say of each other that is not so."""
    yield from _links(linkage)
    for name, joint in linkage.joints.items():
        yield from _joint(("joints", name), joint, known)
    yield from _drivers(linkage, known)
    for name, load in linkage.loads.items():
        yield from _load(("loads", name), load, linkage, known)
    for section in ("initial", "stops"):
        for name in getattr(linkage, section):
            if name not in known.drivers:
                yield _unknown("driver", name, (section, name), known.drivers)


def bad_name(what: str, name: str, where: str = "") -> Problem:
    """The problem of a name that could not stand in an address."""
    found = f"{shown(name)} is not a {what} name"
    return Problem("bad-name", where or name or '""', found, NAME_RULE, "choose another name")


def unknown_kind(word: Any, where: str, section: Section) -> Problem:
    """The problem that names an unknown kind of an item and its nearest relatives."""
    remedy = close_match(word, section.models) if isinstance(word, str) else ""
    found, valid = f"no {section.key} {shown(word)}", f"{section.key}s: {listed(section.models)}"
    return Problem("wrong-value", where, found, valid, remedy)


def _links(linkage: Linkage) -> Iterator[Problem]:
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


def _joint(at: tuple[str, str], joint: Any, known: Known) -> Iterator[Problem]:
    for k, link in enumerate(joint.links):
        yield from _link(link, (*at, "links", k), known)
    for link, number in Counter(joint.links).items():
        if number > 1:
            found = f"{at[1]} joins {link} to itself"
            where = path_text((*at, "links"))
            yield Problem("wrong-value", where, found, "a joint is between different links")


def _link(name: str, path: tuple[str | int, ...], known: Known) -> Iterator[Problem]:
    if name != FRAME and name not in known.links:
        yield _unknown("link", name, path, (*known.links, FRAME))


def _drivers(linkage: Linkage, known: Known) -> Iterator[Problem]:
    by_joint: dict[str, list[str]] = defaultdict(list)
    for name, driver in linkage.drivers.items():
        by_joint[driver.joint].append(name)
        where = ("drivers", name, "joint")
        if driver.joint not in known.joints:
            yield _unknown("joint", driver.joint, where, known.joints)
        elif driver.joint in linkage.joints:
            yield from _two_links(driver.joint, where, linkage, "drives")
    for joint, names in by_joint.items():
        if len(names) > 1:
            found = f"{listed(names)} all drive {joint}"
            valid, remedy = "a joint has one driver", f"remove {names[1]}"
            yield Problem(
                "conflicting-drivers", path_text(("drivers", names[1])), found, valid, remedy
            )


def _two_links(joint: str, path: tuple[str, ...], linkage: Linkage, does: str) -> Iterator[Problem]:
    """The problem of a pin of many links where two are meant."""
    links = linkage.joints[joint].links
    if len(links) > 2:
        found = f"{joint} is a pin of {len(links)} links, and it is not said which two it {does}"
        remedy = "write the pin as joints of two links each"
        yield Problem("wrong-value", path_text(path), found, "", remedy)


def _load(at: tuple[str, str], load: Any, linkage: Linkage, known: Known) -> Iterator[Problem]:
    if (link := getattr(load, "link", None)) is not None:
        yield from _link(link, (*at, "link"), known)
    for k, link in enumerate(getattr(load, "links", None) or ()):
        yield from _link(link, (*at, "links", k), known)
    joint = getattr(load, "joint", None)
    if joint is not None and joint not in known.joints:
        yield _unknown("joint", joint, (*at, "joint"), known.joints)
    elif joint in linkage.joints:
        yield from _two_links(str(joint), (*at, "joint"), linkage, "acts between")
    driver = getattr(load, "driver", None)
    if driver is not None and driver not in known.drivers:
        yield _unknown("driver", driver, (*at, "driver"), known.drivers)


def _unknown(what: str, name: str, path: tuple[str | int, ...], valid: Iterable[str]) -> Problem:
    names = sorted(valid)
    return Problem(
        f"unknown-{what}",
        path_text(path),
        f'no {what} "{name}"',
        f"{what}s: {listed(names) or 'none'}",
        close_match(name, names),
    )
