"""The catalogue: outputs by name, patterns matched, and the plan for a request."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Iterator, Mapping

from blockmech.blocks.contract import DrivingLink
from blockmech.errors import Problem, RequestError, close_match, listed
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.outputs import Output, outputs_of
from blockmech.passes import forces, forward, friction
from blockmech.plan import STAGES, Friction, Plan, Schedule


class Catalogue(Mapping[str, Output]):
    """All outputs of a mechanism by name, made once and on first use."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self._outputs = {o.name: o for o in outputs_of(structure)}

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
            names = [n for n in self._outputs if fnmatch.fnmatchcase(n, pattern)]
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
        return Plan(names, tuple(entries), schedule.program(values), layout)


def _quality(s: Schedule) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Margins and friction reports of what the plan computes anyway."""
    for entry in list(s.entries):
        block = s.structure.blocks[entry.block]
        if entry.stage == "position" and not isinstance(block, DrivingLink):
            yield f"margin/{entry.block}", (f"{s.ask(forward.position, entry.block)}.margin",)
        if entry.stage == "force":
            solved = s.ask(forces.solution, entry.block)
            if solved is None:
                continue
            what = ("iterations", "residual", "contraction", "outcome", "limit")
            yield f"friction/{entry.block}", tuple(f"{solved}.{x}" for x in what)
            for i, ref in enumerate(s.ask(friction.friction_joints, entry.block)):
                yield (
                    f"rest/{ref}",
                    (
                        s.ask(friction.rest, ref),
                        f"{solved}.g[{i}]",
                        s.ask(friction.factor_slot, ref),
                    ),
                )
