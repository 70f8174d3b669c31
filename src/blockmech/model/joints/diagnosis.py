"""Why links and joints make no mechanism, in the trade's words.

Counting and generic rank (`determinacy.diagnose`) tell what holds for almost all lengths. Whether
the given lengths are special, as in a parallelogram with three equal cranks, is told by the
rank of the velocity conditions in the pose of the document (`special`): links that are
over-constrained, and move all the same.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping

from blockmech.assur.diagnosis import Finding, diagnose
from blockmech.assur.formation import formation
from blockmech.assur.groups import Unit
from blockmech.assur.rank import TooTangledError
from blockmech.assur.rigidity import rigidity
from blockmech.errors import Problem, listed, path_text
from blockmech.model.joints.closing import CLOSED, FEW, Closing, Poses
from blockmech.model.joints.connections import structural
from blockmech.model.joints.contents import FRAME
from blockmech.model.joints.special import Layout, Special, special_geometry

CODES: Mapping[str, str] = {
    "unconnected-links": "links that no joint joins to the rest",
    "coincident-joints": "joints at one place, so that they hold nothing, or hold it twice",
    "over-constrained": "links that are held more often than their freedoms are",
    "turning-held-twice": "a loop of sliding joints, which hold the relative turning too often",
    "missing-driver": "more freedoms than drivers",
    "too-many-drivers": "more drivers than freedoms",
    "locked-driver": "a driver whose joint cannot move",
    "conflicting-drivers": "two drivers that prescribe one freedom",
    "loose-links": "links that move with every driver held",
    "too-tangled": "so many links in loops with each other that only counting is left",
    "no-links": "a document without moving links",
    "does-not-close": "joints that gape, and cannot be closed near the given pose",
    "pose-far-off": "a pose from which another assembly mode may be reached than was meant",
    "dead-centre": "a pose that does not tell the assembly mode",
}
"""What can be wrong with links and joints that are named well."""


def why_not(layout: Layout) -> list[Problem]:
    """The reasons why a structure cannot be put in a formation sequence, one for each."""
    if not layout.links:
        remedy = "add links and joints"
        return [Problem("no-links", "links", "there is no moving link", "", remedy)]
    try:
        return _by_rank(layout)
    except TooTangledError:
        return [_by_count(layout)]


def _by_count(layout: Layout) -> Problem:
    """What can be told of very many links in loops: which of them cannot be placed."""
    links, pairs, driven = layout.links, layout.pairs, layout.driven
    counted = structural(pairs, dict.fromkeys(pairs, ""))
    rest = formation(links, counted, (FRAME,), driven).rest
    mobility = 3 * len(links) - 2 * len(pairs)
    found = f"{len(links)} links and {len(pairs)} pairs, 3n - 2p is {mobility}, drivers "
    found += f"{len(driven)}; {listed(rest) or 'some of them'} cannot be placed"
    remedy = "take the mechanism apart, and check the parts"
    return Problem("too-tangled", "joints", found, "each freedom has one driver", remedy)


def _by_rank(layout: Layout) -> list[Problem]:
    together = _coincident(layout)
    if together:
        return together
    findings = diagnose(layout.links, layout.counted, (FRAME,), layout.driven)
    state = rigidity(layout.links, layout.counted, (FRAME,), ())
    said = _Words(layout.drivers, state.mobility, state.counted)
    special = special_geometry(layout, state.mobility)
    if special is not None:
        return said.special(special)
    return said.problems(findings)


def why_stuck(layout: Layout, stuck: Iterable[Unit]) -> list[Problem]:
    """Why groups that are sound by count cannot be placed in the given pose."""
    if 3 * len(layout.links) <= FEW:
        state = rigidity(layout.links, layout.counted, (FRAME,))
        special = special_geometry(layout, state.mobility)
        if special is not None:
            return _Words(layout.drivers, state.mobility, state.counted).special(special)
    why = "their joints do not hold them there"
    return [dead_centre(unit.links, why) for unit in stuck]


def _coincident(layout: Layout) -> list[Problem]:
    """Joints that lie on each other, where that is why the structure cannot work.

    Two of the same two links hold them twice. Others do no harm as such, unless the structure
    would work if they were apart.
    """
    links, pairs, axis, driven = layout.links, layout.pairs, layout.axis, layout.driven
    twice: dict[tuple[frozenset[str], str], list[str]] = defaultdict(list)
    for c in pairs.values():
        if axis[c.name]:
            twice[frozenset(c.links), axis[c.name]].append(c.name)
    found = [
        Problem(
            "coincident-joints",
            path_text(("joints", names[1])),
            f"{listed(names)} join {' and '.join(sorted(both))} at the same place"
            if pairs[names[0]].kind == "R"
            else f"{listed(names)} guide {' and '.join(sorted(both))} in the same direction",
            "two links need one joint there",
            f"remove {listed(names[1:])}",
        )
        for (both, _), names in sorted(twice.items(), key=lambda item: item[1])
        if len(names) > 1
    ]
    if found:
        return found
    apart = structural(pairs, dict.fromkeys(pairs, ""))
    if not any(axis.values()) or not formation(links, apart, (FRAME,), driven).complete:
        return []
    held = rigidity(links, layout.counted, (FRAME,), driven)
    for o in held.overconstrained:
        groups: dict[str, list[str]] = defaultdict(list)
        for name in o.pairs:
            if axis[name]:
                groups[axis[name]].append(name)
        names = [sorted(group) for group in groups.values() if len(group) > 1]
        if not names:
            continue
        kind = pairs[names[0][0]].kind
        where = "lie in one point" if kind == "R" else "slide in one direction"
        loose = sorted({link for part in held.loose for link in part.links})
        effect = f", so {listed(loose)} can move freely" if loose else ""
        found.append(
            Problem(
                "coincident-joints",
                path_text(("joints", names[0][-1])),
                f"{'; '.join(listed(g) for g in names)} {where}{effect}",
                "the joints of a group are apart" if kind == "R" else "guides cross",
                "move one of them",
            )
        )
    return found


EACH = "each freedom has one driver"
FORMULA = "3n - 2p is {counted}, but the mobility is {mobility}"
STATE = " (mobility {mobility}, drivers {drivers})"
TEXTS: Mapping[str, tuple[str, str, str]] = {
    "unconnected-links": (
        "no joint leads from {links} to the frame",
        "",
        "add a joint, or remove them",
    ),
    "over-constrained": (
        "{links} are over-constrained: their joints {pairs} hold them {times} too often{so}",
        FORMULA,
        "remove a joint or a link of them",
    ),
    "turning-held-twice": (
        "{links} are joined in a loop by sliding joints alone ({pairs}), which hold their "
        "relative turning {times} too often{so}",
        FORMULA,
        "make one of the joints a pin on a slider",
    ),
    "locked-driver": (
        "{names} moves nothing: {pairs} cannot move, {links} lock it" + STATE,
        "",
        "drive a joint that can move",
    ),
    "conflicting-drivers": (
        "{names} prescribe the motion of {links} {times} too often" + STATE,
        EACH,
        "remove one of {names}, or drive another freedom",
    ),
    "loose-links": (
        "{links} can still move with every driver held: {number} freedom{s}" + STATE,
        "",
        "add a joint to them, or a driver",
    ),
    "too-many-drivers": (
        "mobility {mobility}, drivers {drivers} ({names}): {number} too many",
        EACH,
        "remove {number} of them",
    ),
}
"""What is found, what is valid and what helps, for every finding but missing drivers."""


class _Words:
    """Findings as problems of a document.

    Parameters
    ----------
    drivers : driven pair -> driver
    mobility, counted : freedoms of the links without drivers, by rank and by 3n - 2p
    """

    def __init__(self, drivers: Mapping[str, str], mobility: int, counted: int) -> None:
        self.drivers = drivers
        self.mobility = mobility
        self.counted = counted

    def problems(self, findings: Iterable[Finding]) -> list[Problem]:
        """One problem for each reason; what only follows from another is part of its text."""
        by_code: dict[str, list[Finding]] = defaultdict(list)
        for finding in findings:
            by_code[finding.code].append(finding)
        locked = by_code["locked-driver"]
        found = [self._problem(f) for f in by_code["unconnected-links"]]
        for f in by_code["over-constrained"] + by_code["turning-held-twice"]:
            moving = set(f.links) - {FRAME}
            own = [d for d in locked if moving & set(d.links)]
            stuck = listed([self.drivers[p] for d in own for p in d.pairs])
            found.append(self._problem(f, f", so {stuck} cannot move" if own else ""))
            locked = [d for d in locked if d not in own]
        found += [self._problem(f) for f in (*locked, *by_code["conflicting-drivers"])]
        loose = by_code["loose-links"]
        if by_code["too-few-drivers"]:
            found.append(self._missing(by_code["too-few-drivers"][0].number, loose))
        else:
            found += [self._problem(f) for f in loose]
        return found or [self._problem(f) for f in by_code["too-many-drivers"]]

    def special(self, special: Special) -> list[Problem]:
        """Links that move against the count."""
        found = f"{listed(special.links)} are over-constrained but movable: by count their "
        found += f"joints leave mobility {self.mobility}, but their special lengths leave "
        found += f"{special.freedom}, as in a parallelogram with three equal cranks"
        valid = "the forces in such links are not determined by statics"
        remedy = "remove a link that the motion does not need"
        if special.spare is not None:
            link, joints = special.spare
            remedy = f"remove {link} with its joints {listed(joints)}: the motion stays the same"
        problems = [Problem("over-constrained", _first_of(special.links), found, valid, remedy)]
        wanted = special.freedom - len(self.drivers)
        self.mobility = special.freedom
        if wanted > 0:
            problems.append(self._missing(wanted, ()))
        elif wanted < 0:
            many = Finding("too-many-drivers", (), tuple(sorted(self.drivers)), -wanted, "")
            problems.append(self._problem(many))
        return problems

    def _missing(self, number: int, loose: Iterable[Finding]) -> Problem:
        found = f"mobility {self.mobility}, drivers {len(self.drivers)}: "
        found += f"{number} driver{'s are' if number > 1 else ' is'} missing"
        links = [link for f in loose for link in f.links]
        if links:
            found += f"; {listed(links)} can still move with every driver held"
        remedy = "drive a joint of theirs, or add a joint" if links else "drive a joint of them"
        return Problem("missing-driver", "drivers", found, EACH, remedy)

    def _problem(self, f: Finding, so: str = "") -> Problem:
        names = [self.drivers[p] for p in f.pairs if p in self.drivers]
        words = {
            "links": listed(f.links),
            "pairs": listed(f.pairs),
            "names": listed(names),
            "number": f.number,
            "times": "once" if f.number == 1 else f"{f.number} times",
            "s": "s" * (f.number > 1),
            "so": so,
            "mobility": self.mobility,
            "counted": self.counted,
            "drivers": len(self.drivers),
        }
        where = "drivers" if f.code == "too-many-drivers" else _first_of(f.links)
        if f.code in ("locked-driver", "conflicting-drivers"):
            where = path_text(("drivers", names[-1]))
        return Problem(f.code, where, *(text.format(**words) for text in TEXTS[f.code]))


def _first_of(links: Iterable[str]) -> str:
    """Where the first moving link stands in the document."""
    moving = [link for link in links if link != FRAME]
    return path_text(("links", moving[0])) if moving else "links"


def does_not_close(closing: Closing, given: Poses) -> list[Problem]:
    """The joints that gape most in the given pose."""
    gaps = [g for g in closing.gaps(given) if max(g[1] / closing.size, g[2]) > CLOSED]
    (c, distance, turn), *others = gaps
    found = f"{c.name} gapes by {distance:.3g} m in the given pose"
    if c.kind == "P":
        found = f"{c.name} is off its guide by {distance:.3g} m"
        found += f" and {turn:.3g} rad in the given pose"
    if others:
        found += f", {listed(_gape(d.name, *gap) for d, *gap in others[:3])} as well"
    found += ", and no nearby pose closes all joints"
    return [
        Problem(
            "does-not-close",
            path_text(("joints", c.name.split(".")[0])),
            found,
            '"pose" is approximate, "at" is exact',
            f"check the places of {c.name} on {c.first} and {c.second}, or give better poses",
        )
    ]


def far_off(given: Poses, closed: Poses, size: float) -> Iterator[Problem]:
    """Links that are turned or moved so far to close the joints that the mode is in doubt."""
    for k, link in enumerate(given.links):
        turn = abs(float(closed.theta[k] - given.theta[k]))
        way = abs(complex(closed.o[k] - given.o[k]))
        if turn < math.pi / 2 and way <= size:
            continue
        found = f"to close its joints {link} is turned by {turn:.3g} rad and moved by {way:.3g} m"
        valid = "the pose tells the assembly mode"
        remedy = "give a nearer pose, or turn a guide round that points the wrong way"
        yield Problem("pose-far-off", path_text(("links", link, "pose")), found, valid, remedy)


def _gape(pair: str, distance: float, turn: float) -> str:
    return f"{pair} ({distance:.3g} m" + (f", {turn:.3g} rad)" if turn else ")")


def dead_centre(links: Iterable[str], why: str) -> Problem:
    """The problem of a pose that does not tell which way a group is put together."""
    names = list(links)
    return Problem(
        "dead-centre",
        path_text(("links", names[0])),
        f"{listed(names)} stand at a dead centre in the given pose: {why}",
        "the pose tells the assembly mode",
        "give the poses at another driver value, in which the group is bent",
    )
