"""Programs that let go of each value after its last use.

A batch of values is an array; what is let go makes room for what comes next, so a long
program works in little memory and stays in the cache. Of a pose that only its margin is
returned, only the margin is kept. For Python numbers all this is not worth it.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache

from blockmech.plan import MOST_KEPT, Program

NAME = re.compile(r"(?<![\w.])[^\W\d]\w*")
"""A name in an expression; what stands behind a dot is none, nor the e of 1e-3."""


def releasing(program: Program) -> Program:
    """The same program with ``del`` behind the last use of each input and value."""
    return replace(program, source=_released(program.source, program.inputs, program.outputs))


@lru_cache(maxsize=MOST_KEPT)
def _released(source: str, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> str:
    head, *lines, _ = source.splitlines()
    body, returned = _taken_out(lines, outputs)
    result = f"    return ({''.join(f'{text}, ' for text in returned)})"
    kept = set(NAME.findall(result))  # used later than the line at hand
    known = {*inputs, *map(_made, body)}
    found = [result]
    for line in reversed(body):
        known.discard(_made(line))  # before this line there is no such value
        used = dict.fromkeys(NAME.findall(line.partition(" = ")[2]))
        last = [name for name in used if name in known and name not in kept]
        kept.update(last)
        if last:
            found.append(f"    del {', '.join(last)}")
        found.append(line)
    return "\n".join([head, *reversed(found)]) + "\n"


def _taken_out(lines: list[str], outputs: tuple[str, ...]) -> tuple[list[str], list[str]]:
    """The lines, and parts of values that are returned taken out at once; what to return."""
    made = set(map(_made, lines))
    parts: dict[str, list[str]] = {}
    returned = []
    for k, text in enumerate(outputs):
        whole = NAME.match(text)
        if whole is None or whole.group() == text or whole.group() not in made:
            returned.append(text)
            continue
        name = f"part_{k}"
        while name in made:
            name += "_"
        parts.setdefault(whole.group(), []).append(f"    {name} = {text}")
        returned.append(name)
    return [x for line in lines for x in (line, *parts.get(_made(line), ()))], returned


def _made(line: str) -> str:
    """The name of the value that a line makes."""
    return line.strip().partition(" = ")[0]
