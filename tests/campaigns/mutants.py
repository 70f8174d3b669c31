"""Single mistakes at random, and whether what a user has catches them: a script, not a test.

    python -m tests.campaigns.mutants [--count 40] [--seed 1]

A function of couplings, signals, passes, dynamics, friction or engines that is at work in some
graphs gets one sign or one number wrong. Then these graphs are put through `verify()`,
`verify(motion)` along the path, in time and by machine code, and `verify(study)`. What is caught,
what raises and what nobody sees is counted; the last are printed, to be brought into `verify`, or
to be known as harmless.
"""

from __future__ import annotations
import __future__

import argparse
import ast
import importlib
import inspect
import random
import signal
import sys
import textwrap
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import blockmech as bm
from blockmech.engines.binding import Binder
from tests.gallery import GRAPHS

LONGEST = 40  # [s] for one mutant; one that takes longer counts as seen
SPAN = "time=0.2"
WATT, PUMP, PRESS = "watt_sixbar", "pump", "toggle_press"
COUPLED = ("geared_fivebar", "valve_engine", "rack_gripper", "planetary_hoist")
ROOMS: dict[str, tuple[str, ...]] = {
    **{f"couplings.{m}": COUPLED for m in ("gear", "rack", "cam", "laws", "contract")},
    **{f"signals.{m}": ("control/*",) for m in ("algebra", "dynamic", "sources")},
    **{f"passes.{m}": (*COUPLED, PUMP, "control/*") for m in ("pairs", "signals", "energy")},
    **{f"dynamics.{m}": (WATT, PUMP) for m in ("equation", "system", "along", "panels", "swing")},
    **{f"dynamics.{m}": ("motions/pin_pendulum", WATT) for m in ("friction", "path", "work")},
    **{f"friction.{m}": (PRESS, "ruiz_fourbar") for m in ("equations", "solvers")},
    "friction.laws.stribeck": ("ruiz_fourbar",),
    "engines.derivatives": (WATT,),
    "blocks.rrr": (WATT,),
    "blocks.rrp": (PUMP, "hammer"),
}


class Mutant(NamedTuple):
    """A function with one place of its text changed."""

    where: str
    target: FunctionType
    text: str
    change: str
    graphs: tuple[str, ...]


class Slow(Exception):
    """It did not end in time."""


def functions(module: ModuleType) -> Iterator[tuple[str, FunctionType]]:
    """Functions and methods whose text stands in a module."""
    for name, thing in vars(module).items():
        if inspect.isfunction(thing) and thing.__module__ == module.__name__:
            yield name, thing
        elif inspect.isclass(thing) and thing.__module__ == module.__name__:
            for method, function in vars(thing).items():
                if inspect.isfunction(function):
                    yield f"{name}.{method}", function


def changes(tree: ast.AST) -> Iterator[tuple[str, Callable[[], None]]]:
    """What can be got wrong in a function: a sign, a factor, a number."""
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            operator = ast.Sub() if isinstance(node.op, ast.Add) else ast.Add()
            yield ast.unparse(node), lambda n=node, o=operator: setattr(n, "op", o)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            yield ast.unparse(node), lambda n=node: setattr(n, "op", ast.UAdd())
        elif isinstance(node, ast.Constant) and type(node.value) is float and node.value:
            yield ast.unparse(node), lambda n=node: setattr(n, "value", 1.01 * n.value)


@cache
def used(names: tuple[str, ...]) -> set[CodeType]:
    """The code that runs while a user has these graphs verified."""
    codes: set[CodeType] = set()
    sys.setprofile(lambda frame, event, _: codes.add(frame.f_code) if event == "call" else None)
    try:
        assert checked(names) == "nobody"  # finds a mistake where there is none
    finally:
        sys.setprofile(None)
    return codes


def mutants(count: int, seed: int) -> Iterator[Mutant]:
    """So many of them, the rooms in turn."""
    chance = random.Random(seed)
    rooms = list(ROOMS)
    while count:
        chance.shuffle(rooms)
        for name in rooms[:count]:
            module = importlib.import_module(f"blockmech.{name}")
            at_work = used(ROOMS[name])
            candidates = [
                (called, target)
                for called, target in functions(module)
                if target.__code__ in at_work and target.__code__.co_filename == module.__file__
            ]
            for _ in range(50 if candidates else 0):
                called, target = chance.choice(candidates)
                text = textwrap.dedent(inspect.getsource(target))
                tree = ast.parse(text)
                result = list(changes(tree))
                if result and not target.__code__.co_freevars and "lambda" not in text[:4]:
                    change, make = chance.choice(result)
                    make()
                    yield Mutant(f"{name}.{called}", target, ast.unparse(tree), change, ROOMS[name])
                    count -= 1
                    break


def seen(mutant: Mutant) -> str:
    """Who sees it: a check by name, an error, or "nobody"."""
    space = dict(vars(inspect.getmodule(mutant.target)))
    flags = __future__.annotations.compiler_flag
    exec(compile(mutant.text, "<mutant>", "exec", flags), space)
    right, bound = mutant.target.__code__, Binder._modules
    try:
        mutant.target.__code__, Binder._modules = space[mutant.target.__name__].__code__, {}
    except (KeyError, ValueError):
        return "not made"
    try:
        signal.alarm(LONGEST)
        return checked(mutant.graphs)
    except Slow:
        return "slow"
    except Exception as error:
        return f"raises {type(error).__name__}"
    finally:
        signal.alarm(0)
        mutant.target.__code__, Binder._modules = right, bound


def checked(names: tuple[str, ...]) -> str:
    """The first check of a user that fails."""
    for path in (file for name in names for file in sorted(GRAPHS.glob(f"{name}.json"))):
        mech = bm.Graph.load(path).compile()
        for check, ask in asked(mech):
            try:
                outcome = ask()
            except bm.RequestError:  # a method or study that does not apply
                continue
            if not outcome.ok:
                return f"{check}: {next(row.name for row in outcome.rows if not row.ok)}"
    return "nobody"


def asked(mech: bm.Mechanism) -> Iterator[tuple[str, Callable[[], Any]]]:
    """What a user can have verified of a mechanism."""
    if mech.scene.drive:
        yield "verify()", lambda: mech.verify(samples=5)
    for options in ({}, {"method": "dop853"}, {"method": "dop853", "engine": "llvm"}):
        yield f"verify(motion) {options}", lambda h=options: mech.verify(mech.simulate(SPAN, **h))
    lengths = [a for a in mech.parameters() if a.endswith((".length", ".l", ".l_i"))][:1]
    if lengths and mech.scene.drive:
        x = mech.parameters()[lengths[0]].value
        yield (
            "verify(study)",
            lambda: mech.verify(
                mech.study({lengths[0]: [x, 1.001 * x]}, want="max_abs(*.drive)", samples=7)
            ),
        )


def main() -> None:
    """Make mutants, and print who saw them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()

    def late(*_: Any) -> None:
        raise Slow

    signal.signal(signal.SIGALRM, late)
    warnings.simplefilter("ignore")
    kinds: Counter[str] = Counter()
    for mutant in mutants(options.count, options.seed):
        by = seen(mutant)
        kinds[by.partition(" ")[0].partition(":")[0]] += 1
        print(f"{by:<60} {mutant.where}: {mutant.change}", flush=True)
    print(dict(kinds))


if __name__ == "__main__":
    main()
