"""Why links and joints make no mechanism, in the trade's words.

Counting and generic rank (`assur.diagnosis`) tell what holds for almost all lengths. Whether
the given lengths are special, as in a parallelogram with three equal cranks, is found from the
rank of the velocity conditions in the pose of the document (`closing`).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from blockmech.assur.diagnosis import Finding, diagnose
from blockmech.assur.formation import formation
from blockmech.assur.groups import Unit
from blockmech.assur.rigidity import Rigidity, TooTangledError, rigidity
from blockmech.ground.errors import Problem, listed, path_text
from blockmech.ground.limits import SOLVED
from blockmech.ground.values import MILLI
from blockmech.model.joints.closing import Closing, Gap, gaps, special_geometry
from blockmech.model.joints.contents import FRAME
from blockmech.model.joints.layout import Connection, Layout, Poses

EACH = "the mechanism needs one driver per degree of freedom"
FORMULA = "3n - 2p is {counted}, but the mobility is {mobility}"
REMEDIES: Mapping[str, tuple[str, str]] = {
    "unconnected-links": ("", "add a joint, or remove them"),
    "over-constrained": (FORMULA, "remove a joint or a link of them"),
    "turning-held-twice": (FORMULA, "make one of the joints a pin on a slider"),
    "locked-driver": ("", "drive a joint that can move"),
    "conflicting-drivers": (EACH, "remove one of {names}, or drive another degree of freedom"),
    "loose-links": ("", "add a joint to them, or a driver"),
    "too-many-drivers": (EACH, "remove {number} of them"),
}
"""What is valid and what helps, for every finding but missing drivers."""


def why_not(layout: Layout, unplaced: Iterable[str]) -> list[Problem]:
    """The reasons why a structure cannot be put in a formation sequence, one for each."""
    if not layout.links:
        return [Problem("no-links", "links", "there is no moving link", "", "add links and joints")]
    try:
        together = _coincident(layout)
        if together:
            return together
        findings = diagnose(layout.links, layout.pairs.values(), (FRAME,), layout.drivers)
        return _special(layout) or _problems(layout, findings, _undriven(layout))
    except TooTangledError:
        # What can be said of very many links in loops: which of them cannot be placed.
        links, pairs = len(layout.links), len(layout.pairs)
        message = f"{links} links and {pairs} pairs, 3n - 2p is {3 * links - 2 * pairs}, drivers "
        message += f"{len(layout.drivers)}; {listed(unplaced) or 'some of them'} cannot be placed"
        remedy = "take the mechanism apart, and check the parts"
        return [Problem("too-tangled", "joints", message, EACH, remedy)]


def why_stuck(layout: Layout, stuck: Iterable[Unit]) -> list[Problem]:
    """Why groups that are sound by count cannot be placed in the given pose."""
    why, stuck = "their joints do not hold them there", list(stuck)
    special = _special(layout)
    if not special and Closing.of(layout).stays_weak(layout.given, layout.drivers):
        return [_redundant(unit) for unit in stuck]
    return special or [dead_centre(unit.links, why) for unit in stuck]


def _redundant(unit: Unit) -> Problem:
    """The problem of a group that its joints hold weakly wherever its drivers stand."""
    message = f"{listed(unit.links)} are at a dead centre for every driver value: two ways to put "
    message += "them together are one everywhere, so one of their joints is redundant"
    remedy = f"remove one of {listed(sorted(p.name for p in unit.pairs))}, or make a pin a slider"
    return Problem("dead-centre", _first_of(unit.links), message, "", remedy)


def _undriven(layout: Layout) -> Rigidity:
    return rigidity(layout.links, layout.pairs.values(), (FRAME,))


def _coincident(layout: Layout) -> list[Problem]:
    """Joints that lie on each other, where that is why the structure cannot work.

    Two of the same two links hold them twice. Others do no harm as such, unless the structure
    would work if they were apart.
    """
    pairs = layout.pairs
    twice: dict[tuple[frozenset[str], str], list[str]] = defaultdict(list)
    for c in pairs.values():
        if c.axis:
            twice[frozenset(c.links), c.axis].append(c.name)
    problems = []
    for (both, _), names in sorted(twice.items(), key=lambda item: item[1]):
        if len(names) > 1:
            links = " and ".join(sorted(both))
            text = f"{listed(names)} guide {links} in the same direction"
            if pairs[names[0]].kind == "R":
                text = f"{listed(names)} join {links} at the same place"
            where, remedy = path_text(("joints", names[1])), f"remove {listed(names[1:])}"
            valid = "two links need one joint there"
            problems.append(Problem("coincident-joints", where, text, valid, remedy))
    apart = [replace(c, axis="") for c in pairs.values()]
    if problems or not formation(layout.links, apart, (FRAME,), layout.drivers).complete:
        return problems
    state = rigidity(layout.links, pairs.values(), (FRAME,), layout.drivers)
    loose = sorted({link for part in state.loose for link in part.links})
    effect = f", so {listed(loose)} can move freely" if loose else ""
    for o in state.overconstrained:
        groups: dict[str, list[str]] = defaultdict(list)
        for name in o.pairs:
            if pairs[name].axis:
                groups[pairs[name].axis].append(name)
        together = [group for group in groups.values() if len(group) > 1]
        if together:
            pin = pairs[together[0][0]].kind == "R"
            text = f"{'; '.join(map(listed, together))} "
            text += ("lie in one point" if pin else "slide in one direction") + effect
            where = path_text(("joints", together[0][-1]))
            valid = "the joints of a group are apart" if pin else "guides cross"
            problems.append(Problem("coincident-joints", where, text, valid, "move one of them"))
    return problems


def _problems(layout: Layout, findings: Iterable[Finding], state: Rigidity) -> list[Problem]:
    """One problem for each reason; what only follows from another is part of its text."""
    by_code: dict[str, list[Finding]] = defaultdict(list)
    for finding in findings:
        by_code[finding.code].append(finding)
    locked = by_code["locked-driver"]
    problems = [_problem(layout, f, state) for f in by_code["unconnected-links"]]
    for f in by_code["over-constrained"] + by_code["turning-held-twice"]:
        moving = set(f.links) - {FRAME}
        blocked = [d for d in locked if moving & set(d.links)]
        stuck = listed([layout.drivers[p] for d in blocked for p in d.pairs])
        problems.append(_problem(layout, f, state, f", so {stuck} cannot move" if blocked else ""))
        locked = [d for d in locked if d not in blocked]
    rest = [*locked, *by_code["conflicting-drivers"]]
    missing = by_code["too-few-drivers"]
    if not missing:
        rest += by_code["loose-links"]
    problems += [_problem(layout, f, state) for f in rest]
    problems += [_missing(layout, f, by_code["loose-links"], state.mobility) for f in missing]
    return problems or [_problem(layout, f, state) for f in by_code["too-many-drivers"]]


def _special(layout: Layout) -> list[Problem]:
    """Links that move against the count; none where there are no such, or too many links."""
    if len(layout.links) > SOLVED:
        return []
    state = _undriven(layout)
    special = special_geometry(layout, state.mobility)
    if special is None:
        return []
    message = f"{listed(special.links)} are over-constrained but movable: by count their "
    message += f"joints leave mobility {state.mobility}, but their special lengths leave "
    message += f"{special.freedom}, as in a parallelogram with three equal cranks"
    valid = "the forces in such links are not determined by statics"
    remedy = "remove a link that the motion does not need"
    if special.spare is not None:
        link, joints = special.spare
        remedy = f"remove {link} with its joints {listed(joints)}: the motion stays the same"
    problems = [Problem("over-constrained", _first_of(special.links), message, valid, remedy)]
    lacking, driven = special.freedom - len(layout.drivers), tuple(sorted(layout.drivers))
    if lacking > 0:
        few = Finding("too-few-drivers", (), driven, lacking)
        problems.append(_missing(layout, few, (), special.freedom))
    elif lacking < 0:
        problems.append(_problem(layout, Finding("too-many-drivers", (), driven, -lacking), state))
    return problems


def _missing(layout: Layout, few: Finding, loose: Iterable[Finding], mobility: int) -> Problem:
    message = f"mobility {mobility}, drivers {len(layout.drivers)}: "
    message += f"{few.number} driver{'s are' if few.number > 1 else ' is'} missing"
    links = [link for f in loose for link in f.links]
    if links:
        message += f"; {listed(links)} can still move with every driver held"
    remedy = "drive a joint of theirs, or add a joint" if links else "drive a joint of them"
    return Problem("missing-driver", "drivers", message, EACH, remedy)


def _problem(layout: Layout, f: Finding, state: Rigidity, so: str = "") -> Problem:
    """A finding as a problem of the document."""
    count = f" (mobility {state.mobility}, drivers {len(layout.drivers)})"
    text = f.text(layout.drivers, pair="joint", rest="the frame", so=so, state=count)
    names = [layout.drivers[p] for p in f.pairs if p in layout.drivers]
    where = "drivers" if f.code == "too-many-drivers" else _first_of(f.links)
    if f.code in ("locked-driver", "conflicting-drivers"):
        where = path_text(("drivers", names[-1]))
    values = {"names": listed(names), "number": f.number}
    values |= {"counted": state.counted, "mobility": state.mobility}
    return Problem(f.code, where, text, *(part.format(**values) for part in REMEDIES[f.code]))


def _first_of(links: Iterable[str]) -> str:
    """Where the first moving link stands in the document."""
    moving = [link for link in links if link != FRAME]
    return path_text(("links", moving[0])) if moving else "links"


# Links and joints that are sound by count, and their pose.


def does_not_close(layout: Layout) -> list[Problem]:
    """The joints that gape most in the given pose."""
    (c, distance, turn), *further = gaps(layout.given, layout.pairs.values(), layout.size)
    message = f"joint {c.name} has a closure error of {distance:.3g} m in the given pose"
    if c.kind == "P":
        message = f"{c.name} is off its guide by {distance:.3g} m"
        message += f" and {turn:.3g} rad in the given pose"
    if further:
        message += f", {listed(map(_gape, further[:3]))} as well"
    message += ", and no nearby pose closes all joints"
    where = path_text(("joints", c.name.split(".")[0]))
    valid = '"pose" is approximate, "at" is exact'
    remedy = f"check the places of {c.name} on {c.first} and {c.second}, or give better poses"
    remedy = _slip(layout) or remedy
    return [Problem("does-not-close", where, message, valid, remedy)]


def _slip(layout: Layout) -> str:
    """The link whose places in mm, or in m among mm, let all joints close near their poses.

    A slip shows in that the lengths are more alike without it.
    """
    connections = list(layout.pairs.values())
    tried = []
    for link in (FRAME, *layout.links):
        for factor, times in MILLI.items():
            ends = [
                [x * (factor if k == link else 1) for k, x in zip(c.links, c.at, strict=True)]
                for c in connections
            ]
            pairs = [
                replace(c, at=(first, second))
                for c, (first, second) in zip(connections, ends, strict=True)
            ]
            tried.append((_spread(pairs), link, times, pairs))
    spread, link, times, pairs = min(tried, key=lambda x: x[0])
    closing = Closing(layout.links, pairs, layout.size, {})
    if spread >= _spread(connections) or not closing.closed(closing.refine(layout.given)):
        return ""
    return f"they close with the places on {link} {times}: are they in mm? Lengths are in m"


def _spread(pairs: Iterable[Connection]) -> float:
    """The largest distance of a joint from its link's origin by the smallest."""
    sizes = [abs(x) for c in pairs for x in c.at if x]
    return max(sizes, default=1.0) / min(sizes, default=1.0)


def _gape(gap: Gap) -> str:
    turn = f", {gap.turn:.3g} rad" if gap.turn else ""
    return f"{gap.pair.name} ({gap.distance:.3g} m{turn})"


def far_off(layout: Layout, closed: Poses) -> Iterator[Problem]:
    """Links that are turned or moved so far to close the joints that the mode is in doubt."""
    for link in layout.links:
        (o, theta), (o_closed, theta_closed) = layout.given[link], closed[link]
        turn, distance = abs(theta_closed - theta), abs(o_closed - o)
        if turn < math.pi / 2 and distance <= layout.size:
            continue
        message = (
            f"to close its joints {link} is turned by {turn:.3g} rad and moved by {distance:.3g} m"
        )
        valid = "the pose tells the assembly mode"
        remedy = "give a nearer pose, or turn a guide round that points the wrong way"
        yield Problem("pose-far-off", path_text(("links", link, "pose")), message, valid, remedy)


def dead_centre(links: Iterable[str], why: str) -> Problem:
    """The problem of a pose that does not tell which way a group is put together."""
    names = list(links)
    message = f"{listed(names)} are at a dead centre in the given pose: {why}"
    valid = "the pose tells the assembly mode"
    remedy = "give the poses at another driver value, in which the group is bent"
    return Problem("dead-centre", path_text(("links", names[0])), message, valid, remedy)
