"""Every exception of blockmech, and the problem as data that it renders.

A `Problem` says where, what was found, what is valid there and what to do. The text of exceptions
is rendered from their problems, so the command line, ``--json`` and tests read the same source.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from importlib import import_module
from itertools import islice
from pkgutil import resolve_name
from textwrap import shorten
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias, TypeVar

Path: TypeAlias = Sequence[str | int]
"""A place in a JSON document: keys and indices."""
T = TypeVar("T")


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong, as data.

    Attributes
    ----------
    code : short stable name, e.g. ``"unwired-joint"``
    where : address, e.g. ``"dyad.B"`` or ``"blocks.dyad.l_i"``
    found : what was found there
    valid : what is valid there (may be empty)
    remedy : one thing to do (may be empty)
    file : the file it came from, if any

    >>> print(bm.Problem("taken-name", "crank", "there is one", remedy="choose another name"))
    [taken-name] crank: there is one. choose another name.
    """

    code: str
    where: str
    found: str
    valid: str = ""
    remedy: str = ""
    file: str = ""

    def __post_init__(self) -> None:
        for part in fields(self):  # names from a file may hold signs that are none, or no end
            text = printable(getattr(self, part.name)[: LONGEST + 1])
            object.__setattr__(self, part.name, _cut(text, LONGEST))

    def __str__(self) -> str:
        head = ": ".join(part for part in (self.file, self.where, self.found) if part)
        sentences = [f"[{self.code}] {head}"]
        sentences += [part for part in (self.valid, self.remedy) if part]
        return " ".join(s if s.endswith((".", "!", "?")) else s + "." for s in sentences)

    def to_dict(self) -> dict[str, str]:
        """The problem as a JSON object."""
        return {k: v for k, v in asdict(self).items() if v}


class BlockmechError(Exception):
    """Base class of all errors of blockmech.

    >>> try:
    ...     g.connect("crank.B", "dyad.X")
    ... except bm.BlockmechError as error:
    ...     print(error.problems[0].valid)
    joints that take a wire: B, D
    """

    def __init__(self, problems: Problem | Iterable[Problem]) -> None:
        if isinstance(problems, Problem):
            problems = [problems]
        self.problems: tuple[Problem, ...] = tuple(problems)
        super().__init__()

    @classmethod
    def raise_for(cls, problems: Iterable[Problem]) -> None:
        """Raise it with all of some problems, if there are any."""
        if problems := tuple(problems):
            raise cls(problems)

    def __str__(self) -> str:
        return "\n".join(str(p) for p in self.problems)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.problems,), self.__dict__


class GraphError(BlockmechError):
    """The wiring is wrong: all problems found, as data.

    >>> g.connect("crank.B", "dyad.X")
    Traceback (most recent call last):
        ...
    blockmech.ground.errors.GraphError: [unknown-joint] dyad.X: no joint "X". joints that ...
    """


class FormatError(BlockmechError):
    """A file is invalid; each problem names line and column, or the JSON path.

    >>> bm.Graph.from_json("{}")
    Traceback (most recent call last):
        ...
    blockmech.ground.errors.FormatError: [wrong-format] format: the file has no format. a ...
    """


class RequestError(BlockmechError):
    """A call has unknown names, or arguments that do not fit together.

    >>> mech.run(at=0.5, want="crank.driv")
    Traceback (most recent call last):
        ...
    blockmech.ground.errors.RequestError: [unknown-output] crank.driv: no output has that ...
    """


def refused(
    where: str, message: str, remedy: str = "", valid: str = "", code: str = "bad-request"
) -> RequestError:
    """The error of a call that makes no sense, with its one problem."""
    return RequestError(Problem(code, where, message, valid, remedy))


def as_names(where: str, raw: Any) -> tuple[str, ...]:
    """The names that a call gives, one alone or several. Raises `RequestError` for what is none."""
    alone = isinstance(raw, str) or not isinstance(raw, Iterable)
    names: tuple[Any, ...] = (raw,) if alone else tuple(raw)
    if not all(isinstance(name, str) for name in names):
        raise refused(where, f"got {brief(raw)}", "give a name, or several")
    return names


def among(
    valid_names: Iterable[str],
    kind: str,
    requested: Iterable[str] | str | None,
    code: str = "bad-request",
    where: str = "",
    remedy: str = "",
) -> tuple[str, ...]:
    """The names that a call gives, which are all known. Raises `RequestError` for others.

    ``where`` is the argument that gives them; ``remedy`` is what to do where none is near.
    """
    names, choices = as_names(where or kind, requested), tuple(valid_names)
    if unknown := [name for name in names if name not in choices]:
        raise RequestError(
            unknown_name(code, kind, name, where or name, choices, remedy) for name in unknown
        )
    return names


class NotComputedError(RequestError, KeyError):
    """A result does not hold the output that is read from it."""


def held(table: Mapping[str, T], name: Hashable, found: str, label: str, remedy: str = "") -> T:
    """What is kept under a name. Raises `NotComputedError` for a name that is none."""
    if not isinstance(name, str) or name not in table:
        nearest = close_match(str(name), table) or remedy
        valid = f"{label}: {listed(table, 16)}"
        raise NotComputedError(Problem("not-wanted", str(name), found, valid, nearest))
    return table[name]


class MissingEngineError(BlockmechError):
    """An optional package is needed; the remedy names the extra to install.

    >>> issubclass(bm.MissingEngineError, bm.BlockmechError)
    True
    """


def needed(module: str, where: str, extra: str, instead: str = "") -> Any:
    """An optional package. Raises `MissingEngineError` that names the extra to install.

    ``where`` asks for it; ``instead`` says what does without it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        found = f"the package {module.partition('.')[0]} is not installed"
        remedy = f'pip install "blockmech[{extra}]"'
        problem = Problem("missing-package", where, found, instead, remedy)
        raise MissingEngineError(problem) from error


@dataclass
class SampleFailure:
    """Samples without an answer: which, where, and how far off.

    Attributes
    ----------
    block : the block that fails
    samples : indices of the failing samples
    drivers : driver values at the first failing sample [rad or m]
    margin : the block's margin there [-], NaN if it has none
    """

    block: str
    samples: Sequence[int]
    drivers: dict[str, float]
    margin: float = float("nan")


class SampleError(BlockmechError):
    """Some requested samples have no answer; ``failure`` has the numbers."""

    def __init__(self, problems: Problem | Iterable[Problem], failure: SampleFailure) -> None:
        super().__init__(problems)
        self.failure = failure

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.problems, self.failure)


class AssemblyError(SampleError):
    """A group cannot close at some samples.

    >>> g.replace({"dyad.l_i": 20.0}).run(at=0.5)
    Traceback (most recent call last):
        ...
    blockmech.ground.errors.AssemblyError: [no-assembly] dyad at crank.q = 0.5 rad (sample ...
    """


class SingularError(SampleError):
    """A group is at a dead centre: it can be assembled, but rates and reactions do not exist.

    >>> issubclass(bm.SingularError, bm.BlockmechError)
    True
    """


class FrictionError(SampleError):
    """The friction equations have no solution at a sample, or the iteration did not converge.

    >>> issubclass(bm.FrictionError, bm.BlockmechError)
    True
    """


LONGEST_NAME, MOST_NAMES = 64, 300  # what is compared, so that any file is answered soon
SYNONYMS = {
    term: names
    for terms, names in (
        ("torque moment", ("drive", "moment", "couple", "law")),
        ("force", ("reaction", "drive", "law", "tension")),
        ("omega w rpm speed", ("rate", "omega")),
        ("alpha", ("acceleration",)),
        ("theta q", ("angle", "q", "coordinate")),
        ("phi", ("angle", "phase", "q")),
        ("velocity v", ("v", "omega", "rate")),
        ("position", ("p", "q", "angle", "at")),
        ("point", ("at",)),
        ("stiff k", ("stiffness",)),
        ("c", ("damping",)),
        ("gain", ("k",)),
        ("com cog cg centre center", ("cm",)),
        ("m weight density", ("mass",)),
        ("i j", ("inertia",)),
        ("mu coeff friction_coefficient", ("coefficient",)),
        ("std sigma sd standard_deviation", ("deviation",)),
        ("radii d diameter", ("radius", "mean_diameter")),
        ("r", ("radius", "length")),
        ("l len length", ("length", "l", "l_i")),
        ("offset", ("h",)),
        ("l0 preload", ("free_length",)),
        ("l_1 l1", ("l_i", "length", "l")),
        ("l_2 l2", ("l_j",)),
        ("h_1", ("h_i", "h1")),
        ("h_2", ("h_j", "h2")),
        ("t", ("times", "time", "duration")),
        ("t_end", ("until",)),
        ("x", ("arguments", "coordinate")),
        ("y", ("values",)),
        ("direction", ("dir",)),
        ("efficiency", ("friction_efficiency",)),
        ("names outputs", ("want",)),
        ("count", ("sampling", "samples")),
        ("points n", ("samples",)),
        ("reactions forces", ("reaction",)),
        ("upper", ("high",)),
        ("dof degrees_of_freedom", ("mobility",)),
        ("quick_return time_ratio stroke", ("stroke", "extremes")),
        ("add_marker", ("add_link",)),
        ("add_friction friction", ("add_joint",)),
        ("revolute pin hinge rotational", ("R",)),
        ("prismatic slider translational", ("P",)),
        ("fixed rigid", ("weld",)),
        ("ground base world", ("frame",)),
        ("gas pressure", ("thrust",)),
        ("damper", ("spring",)),
        ("film movie gif animation animate", ("animate", "draw")),
        ("info show_info describe", ("check",)),
        ("unit units to degrees", ("deg", "to", "unit")),
        ("plot show picture plot_mechanism", ("plot", "draw")),
        ("max min maximum minimum range transmission_angle", ("extremes",)),
        ("dead_centres dead_centers grashof", ("limits",)),
        ("frequencies natural_frequencies", ("linearize", "equilibria")),
        ("optimize optimise minimize", ("objective", "study")),
        ("objective constraint constraints argmin argmax", ("best",)),
        ("at iloc sel select index", ("run", "isel")),
        ("export save to_dxf to_excel to_numpy to_npz", ("write", "to_csv")),
        ("to_pandas df", ("to_dataframe",)),
        ("load open", ("read",)),
        ("wire add_wire join attach", ("connect",)),
        ("remove delete pop disconnect rename change edit set update", ("replace",)),
        ("remove_link remove_joint remove_load remove_block set_friction", ("replace",)),
        ("dyad", ("RRR",)),
    )
    for term in terms.split()
}
"""What the trade calls a quantity -> names that it may have here."""
SHORT = 2  # letters of symbols: which one is like another says nothing of what they mean


def close_match(word: str, valid: Iterable[str]) -> str:
    """A remedy that names the nearest valid word, or an empty string."""
    match = next(_matches(word, list(islice(valid, MOST_NAMES))), "")
    return f'did you mean "{match}"?' if match and len(word) <= LONGEST_NAME else ""


def _matches(word: str, names: list[str]) -> Iterator[str]:
    """The names that a word may mean, the likeliest first."""
    roots = [name for name in names if word.endswith(f".{name}")]  # a root too many
    yield from sorted(roots, key=len, reverse=True)
    yield from (name for name in names if f".{word}." in f".{name}")  # a link, joint or marker
    head, dot, last = word.rpartition(".")
    synonyms = SYNONYMS.get(last.lower(), ())
    yield from (f"{head}{dot}{x}" for x in synonyms if f"{head}{dot}{x}" in names)
    for synonym in (word, *synonyms):  # of a driver by another name
        yield from (name for name in names if name.endswith(f".{synonym}"))
    if len(word) <= SHORT:
        yield from (name for name in names if _letters(name) == _letters(word))
        return
    siblings = {x.rpartition(".")[2]: x for x in names if x.rpartition(".")[:2] == (head, dot)}
    ends, end = (siblings, last) if siblings else ({name: name for name in names}, word)
    like = [x for x in ends if abs(len(x) - len(end)) <= len(end)]
    yield from (ends[x] for x in difflib.get_close_matches(end, like, n=1, cutoff=0.6))


def _letters(name: str) -> str:
    return name.replace("_", "").lower()


def elsewhere(name: str, homes: Mapping[str, object]) -> str:
    """What to write for a name that an object lacks, or an empty string.

    ``homes`` is phrase -> what may have that name or a synonym, also as a dotted path.
    """
    modules = {x: resolve_name(at) if isinstance(at, str) else at for x, at in homes.items()}
    synonyms = dict.fromkeys((name, *SYNONYMS.get(name.lower(), ())))
    phrases = [x.format(word) for word in synonyms for x, at in modules.items() if word in dir(at)]
    phrases.sort(key=lambda phrase: "." in phrase)  # those of the object itself first
    return f": write {' or '.join(phrases[:2])}" if phrases else ""


NAMESPACES = "draw", "design", "dist", "friction", "laws", "motion", "signals", "synthesis"
EVERYWHERE = {f"blockmech.{x}.{{}}": f"blockmech.{x}" for x in NAMESPACES}


class MissingAttributeError(AttributeError):
    """What has the name that a `Guided` object lacks, looked up when somebody reads it."""

    def __init__(self, owner: Guided, attribute: str) -> None:
        super().__init__(name=attribute, obj=owner)
        self.owner, self.attribute = owner, attribute

    def __str__(self) -> str:
        owner, name = self.owner, self.attribute
        message = f"{type(owner).__name__!r} object has no attribute {name!r}"
        homes = {"{}": type(owner), **owner._homes, **EVERYWHERE, "blockmech.{}": "blockmech"}
        entries = list(owner) if isinstance(owner, Mapping) else []
        entry = next((f': write ["{x}"]' for x in _matches(name, entries)), "")
        return message + (elsewhere(name, homes) or entry)


class Guided:
    """A class whose errors about missing attributes name the object that has them.

    ``_homes`` is phrase -> path of such an object. A mapping may have the name as an entry.
    """

    _homes: ClassVar[Mapping[str, str]] = {}

    if not TYPE_CHECKING:  # which tells of names that are not there by itself

        def __getattr__(self, name: str) -> Any:
            raise MissingAttributeError(self, name)


def listed(items: Iterable[str], limit: int = 12) -> str:
    """Words as a readable list, cut when it is long."""
    items = list(items)
    cut = ", ".join(items[:limit])
    return cut + (f", ... ({len(items)} in all)" if len(items) > limit else "")


def shown(raw: object, limit: int = 60) -> str:
    """A value as it stands in the file, cut when it is long."""
    try:
        text = json.dumps(raw, ensure_ascii=False)
    except (TypeError, ValueError):  # not from a file
        text = repr(raw)
    return printable(_cut(text, limit))


def brief(value: object) -> str:
    """A value as Python shows it, cut between words where it is long."""
    text = repr(value)
    return shorten(text, 60, placeholder=" ...") if " " in text[:55] else text[:60]


def _cut(text: str, limit: int) -> str:
    return text if len(text) <= limit else text[: limit - 3] + "..."


def path_text(path: Path) -> str:
    """A place in a JSON document, e.g. ``wires[2].from``."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        elif re.fullmatch(r'[^\s./\[\]"]+', part):
            text += f".{part}" if text else part
        else:
            text += f"[{shown(part)}]"
    return text


def unknown_key(where: str, owner: str, key: str, keys: Iterable[str]) -> Problem:
    """The problem that names a key and the ones that are valid there."""
    keys = list(keys)
    valid = f"keys there: {listed(keys, 20)}" if keys else ""
    message = f"{owner} has no key {shown(key)}"
    remedy = "write one of these, or remove it" if keys else "remove it"
    return Problem("unknown-key", where, message, valid, close_match(key, keys) or remedy)


def unknown_name(
    code: str,
    kind: str,
    name: str,
    where: str,
    candidates: Iterable[str],
    remedy: str = "",
    there: str = "",
) -> Problem:
    """The problem of a name that is none of a kind's, with those and the nearest of them.

    ``there`` says in words where they are; ``remedy`` is what to do where none is near.
    """
    names = list(candidates)
    valid = f"{kind}s{there}: {listed(names, 16) or 'none'}"
    remedy = close_match(name, names) or remedy
    return Problem(code, where, f'no {kind} "{name}"', valid, remedy)


# The problems of a file.

MOST = 100  # problems that are listed
LONGEST = 600  # characters of one part of a message


def in_file(problems: Iterable[Problem], file: str) -> list[Problem]:
    """Problems as they are shown: each once, with the file, not endless."""
    once = list(dict.fromkeys(problems))
    problems_of_file = [replace(p, file=p.file or file) for p in once[:MOST]]
    if len(once) > MOST:
        problems_of_file.append(
            Problem(once[MOST].code, "", f"and more after these {MOST}", file=file)
        )
    return problems_of_file


def said_already(problem: Problem, problems: Iterable[Problem]) -> bool:
    """Whether one of the problems is at the same place, or inside it."""
    inside = (f"{problem.where}.", f"{problem.where}[")
    return any(p.where == problem.where or p.where.startswith(inside) for p in problems)


def printable(text: str, but: str = "") -> str:
    """Text without signs that move a cursor, colour or turn round what follows: escaped.

    ``but`` are signs that stay as they are, e.g. the ends of lines.
    """
    plain = text
    for sign in but:
        plain = plain.replace(sign, "")
    if plain.isprintable():
        return text
    return "".join(c if c.isprintable() or c in but else json.dumps(c)[1:-1] for c in text)
