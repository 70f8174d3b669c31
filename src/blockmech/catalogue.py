"""The catalogue: outputs by name, patterns matched, and the plan for a request."""

from __future__ import annotations

import fnmatch
import gc
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

from blockmech.errors import Problem, RequestError, close_match, listed
from blockmech.model.naming import Names
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.outputs import outputs_of
from blockmech.outputs_by_link import outputs_by_link
from blockmech.passes import forces, forward, friction
from blockmech.plan import STAGES, Friction, Output, Plan, Schedule


@contextmanager
def uncollected() -> Iterator[None]:
    """No search for garbage meanwhile.

    Everything that is made here is kept: for a chain of a thousand dyads the search took as
    long as the work.
    """
    running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if running:
            gc.enable()


class Catalogue(Mapping[str, Output]):
    """All outputs of a mechanism by name, made once and on first use."""

    def __init__(self, structure: Structure, names: Names | None = None) -> None:
        """With ``names`` the outputs are those of a joint-based document, and no others."""
        self.structure = structure
        with uncollected():
            self._outputs = {o.name: o for o in outputs_of(structure)}
            if names is not None:
                found = outputs_by_link(structure, names, self._outputs)
                self._outputs = {o.name: o for o in found}

    def __getitem__(self, name: str) -> Output:
        return self._outputs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._outputs)

    def __len__(self) -> int:
        return len(self._outputs)

    def match(self, want: Iterable[str]) -> tuple[str, ...]:
        """Names that the patterns ask for, in the catalogue's order.

        Raises `RequestError` for a pattern that matches nothing, all at once.
        """
        found: dict[str, None] = {}
        problems = []
        for pattern in want:
            if pattern in self._outputs:
                found[pattern] = None
                continue
            fits = re.compile(fnmatch.translate(pattern)).match
            names = [n for n in self._outputs if fits(n)]
            if not names:
                problems.append(
                    Problem(
                        "unknown-output",
                        pattern,
                        "no output has that name",
                        f"outputs there: {listed(self._near(pattern), 16)}",
                        close_match(pattern, self._outputs),
                    )
                )
            found.update(dict.fromkeys(names))
        if problems:
            raise RequestError(problems)
        order = {n: i for i, n in enumerate(self._outputs)}
        return tuple(sorted(found, key=order.__getitem__))

    def _near(self, pattern: str) -> list[str]:
        head = pattern.split(".")[0] + "."
        return [n for n in self._outputs if n.startswith(head)] or list(self._outputs)

    def plan(
        self,
        scene: Scene,
        want: Iterable[str],
        how: Friction,
        static: bool = False,
        quality: bool = True,
    ) -> Plan:
        """The plan for some outputs: rules are asked in name order, once each."""
        names = self.match(want)
        with uncollected():
            return self._plan(scene, names, how, static, quality)

    def _plan(
        self, scene: Scene, names: tuple[str, ...], how: Friction, static: bool, quality: bool
    ) -> Plan:
        schedule = Schedule(self.structure, scene, how, static)
        values: dict[str, int] = {}  # the same value under two names is returned once
        layout: dict[str, tuple[int, ...]] = {}

        def place(name: str, asked: Iterable[str]) -> None:
            layout[name] = tuple(values.setdefault(v, len(values)) for v in asked)

        for name in sorted(names):
            place(name, self._outputs[name].ask(schedule))
        if quality:
            for name, asked in _quality(schedule):
                place(name, asked)
        order = {b: i for i, b in enumerate(self.structure.blocks)}
        entries = sorted(
            schedule.entries, key=lambda e: (STAGES.index(e.stage), order[e.block], e.driver)
        )
        return Plan(names, tuple(entries), schedule.program(values), layout, tuple(schedule.shares))


def _quality(s: Schedule) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Margins and friction reports of what the plan computes anyway."""
    for entry in list(s.entries):
        if entry.stage == "position" and s.structure.blocks[entry.block].closes:
            yield f"margin/{entry.block}", (s.ask(forward.margin, entry.block),)
            if s.structure.blocks[entry.block].own_form:
                yield f"path/{entry.block}", (f"{s.ask(forward.position, entry.block)}.reached",)
        if entry.stage == "force":
            yield from _friction_quality(s, entry.block)


def _friction_quality(s: Schedule, block: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """How the friction of a block was solved, and which of its pairs rest."""
    joints = s.ask(friction.friction_joints, block)
    found = [(ref, *at) for ref in joints if (at := s.ask(forces.friction_at, ref)) is not None]
    if not found:
        return
    solved = s.ask(forces.solution, block) or found[0][1]
    what = ("iterations", "residual", "contraction", "outcome", "limit")
    yield f"friction/{block}", tuple(f"{solved}.{x}" for x in what)
    for ref, by, i in found:
        rest = (s.ask(friction.rest, ref), f"{by}.g[{i}]", s.ask(friction.factor_slot, ref))
        yield f"rest/{ref}", rest
