"""Programs kept by form: mechanisms that differ in numbers alone share what was planned for one.

Rules read names, kinds and flags of a mechanism, and of its numbers what their form says
(`blockmech.ground.forms`). Of numbers that they compute the form is held against that of the
mechanism at hand (`Schedule.planned`). What users' classes and functions decide is not known:
mechanisms with these are planned each for itself.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from types import FunctionType
from typing import Any, NamedTuple, TypeVar

from blockmech.ground.forms import form_of
from blockmech.ground.memory import Recent
from blockmech.model.scene import Scene
from blockmech.model.structure import Structure
from blockmech.plan.plan import Formula, Program, Schedule
from blockmech.plan.values import Value

T = TypeVar("T")


class Recipe(NamedTuple):
    """A program and what was planned with it.

    computed : numbers that rules computed, with their forms
    """

    computed: tuple[tuple[Formula, Hashable], ...]
    program: Program
    rest: Any


_RECIPES = Recent[Hashable, Recipe]()


def program_of(
    structure: Structure,
    scene: Scene,
    question: Hashable,
    make: Callable[[], tuple[Schedule, Iterable[Value], T]],
) -> tuple[Program, T]:
    """The program of a mechanism that answers a question, and what is planned with it.

    question : None where more than the form decides on the answer
    make : the schedule, what its program returns, and what else is planned, all of which hold for
        every mechanism of the form
    """
    no_form = structure.form is None or question is None
    key = None if no_form else (structure.form, form_of(scene), question)
    recipe = _RECIPES.get(key)
    if recipe is None or any(form_of(f(structure, scene)) != x for f, x in recipe.computed):
        schedule, outputs, rest = make()
        program = schedule.program(outputs)
        if key is None or not all(map(_is_bare, program.functions.values())):
            return program, rest
        computed = tuple((f, form_of(f(structure, scene))) for f in schedule.computed)
        recipe = Recipe(computed, program, rest)
    else:
        program = recipe.program.of(structure, scene)
    _RECIPES.renew(key, recipe)
    return program, recipe.rest


def _is_bare(value: Any) -> bool:
    """Whether a function, or what it holds, holds no number of its mechanism."""
    if isinstance(value, FunctionType):
        return all(_is_bare(cell.cell_contents) for cell in value.__closure__ or ())
    if isinstance(value, tuple):
        return all(map(_is_bare, value))
    return value is None or isinstance(value, str | int | type) or hasattr(value, "of")
