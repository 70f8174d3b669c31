"""A plan as a JavaScript function of arrays: the statements of the C text in another language.

Sine, cosine, arc tangent and hypotenuse are worked out in twice the digits (`numbers.js`): what a
browser has of its own is not rounded as Python's, and differs from browser to browser.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import accumulate
from pathlib import Path

import numpy as np

from blockmech.exchange.c.program import CProgram
from blockmech.exchange.c.statements import DOUBLE, Language, Statements, literal
from blockmech.result.result import Result
from blockmech.result.samples import Samples

WEB = Path(__file__).with_name("web")
OWN = {"fmod": "rest", "rint": "even"} | {x: f"Math.{x}" for x in ("sqrt", "abs", "exp", "pow")}
SPECIAL = {"NAN": "NaN", "INFINITY": "Infinity", "-INFINITY": "-Infinity"}


def _literal(x: float) -> str:
    text = literal(x, DOUBLE)
    return SPECIAL.get(text, text)


SCRIPT = Language(
    {"real": "const", "int": "const"},
    {"real": "let", "int": "let"},
    "const {name} = [{entries}]",
    lambda op: OWN.get(op, op),
    _literal,
    {},
)


def numbers() -> str:
    """The functions that scripts call, as text."""
    return (WEB / "numbers.js").read_text("utf-8").partition("\nexport")[0]


class Script(CProgram):
    """The JavaScript text of some outputs of a mechanism.

    ``text(name)`` defines ``name(p, u, out)``: it writes the outputs for parameters and inputs,
    all arrays of numbers in the order of the attributes, and returns 0 or the number of the reason
    why there is no answer. Arguments and errors are those of `CProgram`.
    """

    @property
    def values(self) -> list[float]:
        """The parameters of the mechanism, one after the other."""
        return [x for member in self.parameters for x in member.numbers]

    def text(self, name: str) -> str:
        """The function's text; it needs `numbers`."""
        sizes = [len(member.numbers) for member in self.parameters]
        starts = [0, *accumulate(sizes)]
        tables = {
            first: f"p.slice({first}, {first + size})"
            for first, size, member in zip(starts, sizes, self.parameters, strict=False)
            if member.is_array
        }
        count, arrays = starts[-1], []
        parameters = [f"p[{i}]" for i in range(count)]
        for k, table in enumerate(self._trace.tables):
            tables[count], count = f"{name}_{k}", count + len(table)
            parameters += [f"{name}_{k}[{i}]" for i in range(len(table))]
            arrays.append(f"const {name}_{k} = [{', '.join(map(_literal, table.tolist()))}];\n")
        inputs = [f"u[{i}]" for i in range(len(self.inputs))]
        statements = Statements(inputs, parameters, tables, SCRIPT)
        body = statements.text([*self._results.values(), self._status])
        ends = "".join(
            f"    out[{i}] = {statements.name(self._results[output])};\n"
            for i, output in enumerate(self.outputs)
        )
        end = f"    return Number({statements.name(self._status)});\n}}\n"
        return f"{''.join(arrays)}function {name}(p, u, out) {{\n{body}{ends}{end}"

    def compact(self) -> str:
        """The program for `program.js`, which runs it without eval: its operations, one a line.

        A value has no name; lines after it name it by the distance ``~k``, so that programs of
        equal groups have equal lines, and a program is deflated to a third.
        """
        return compacted(self.text("t").splitlines()[:-1])

    def rows(self, samples: Samples) -> list[list[float]]:
        """The inputs (n, k) at some samples."""
        inputs = samples.given(self.plan.program.inputs)
        columns = [np.broadcast_to(inputs[x], samples.n) for x in self.plan.program.inputs]
        return [[float(column[i]) for column in columns] for i in range(samples.n)]

    def answers(self, result: Result) -> list[list[float]]:
        """What a result of the same outputs has for them, (n, outputs)."""
        rows: list[list[float]] = np.stack(
            [self.column(result, name) for name in self.outputs], axis=1
        ).tolist()
        return rows


def compacted(lines: Iterable[str]) -> str:
    """Statements, whose values are named by how many lines they stand back."""
    texts: list[str] = []
    order: dict[str, int] = {}
    for line in lines:
        defined = re.match(r" *const (x\d+) = (.*);", line)
        text = defined[2] if defined else line.strip()
        texts.append(re.sub(r"\bx\d+", lambda x: f"~{len(order) - order[x[0]]}", text))
        if defined:
            order[defined[1]] = len(order)
    return "\n".join(text for text in texts if not text.startswith("function"))
