"""C text compiled by the machine's compiler and called from Python."""

from __future__ import annotations

import ctypes
import dataclasses
import shutil
import subprocess
import sys

import numpy as np
import pytest

from blockmech.exchange.c.program import poses
from blockmech.result.result import Result

COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
FLAGS = ["-Wall", "-Wextra", "-Werror", "-std=c99", "-ffp-contract=off"]
NEEDS_C = pytest.mark.skipif(
    not COMPILERS or sys.platform == "win32", reason="needs gcc or clang of POSIX"
)


def compiled(folder, name, *sources, compiler=None, shared=False, level="-O1"):
    """Compile files of a folder; the program or library made."""
    target = folder / f"{name}_{'library.so' if shared else 'program'}"
    flags = ["-shared", "-fPIC"] if shared else []
    files = [str(folder / source) for source in sources]
    command = [compiler or COMPILERS[0], *FLAGS, level, *flags, *files, "-lm", "-o", str(target)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr[:3000]
    return target


BATCH = """#include "{name}.h"
void batch(const {name}_inputs *in, {name}_outputs *out, int *words, long n)
{{
    for (long i = 0; i < n; ++i) words[i] = {name}(&{name}_defaults, in + i, out + i);
}}
"""


class Called:
    """A `CProgram` as machine code: answers (n, outputs) and words (n,) at samples."""

    def __init__(self, program, folder, compiler=None, level="-O1"):
        self.program, name = program, program.name
        texts = {f"{name}.h": program.header, f"{name}.c": program.source}
        texts["batch.c"] = BATCH.format(name=name)
        for file, text in texts.items():
            (folder / file).write_text(text, "ascii")
        options = {"compiler": compiler, "shared": True, "level": level}
        library = compiled(folder, name, f"{name}.c", "batch.c", **options)
        self.library = ctypes.CDLL(str(library))

    def __call__(self, samples):
        expected = self.program.plan.program.inputs
        columns = samples.given(expected)
        n, k = samples.n, len(expected)
        inputs = np.zeros((n, max(k, 1)))
        for j, name in enumerate(expected):
            inputs[:, j] = np.asarray(columns[name], float)
        values, statuses = np.empty((n, len(self.program.outputs))), np.empty(n, np.intc)
        arrays = (ctypes.c_void_p(x.ctypes.data) for x in (inputs, values, statuses))
        self.library.batch(*arrays, ctypes.c_long(n))
        return values, statuses


def states(mechanism, n, seed):
    """n random states: a tenth beyond the mechanism's range, rates of both signs, any time."""
    rng = np.random.default_rng(seed)
    ranges = poses(mechanism, 361)
    at, rates, accelerations = {}, {}, {}
    for i, driver in enumerate(mechanism.drivers):
        q = ranges.coordinate(i)
        overlap = 0.1 * (q.max() - q.min())
        at[driver] = rng.uniform(q.min() - overlap, q.max() + overlap, n)
        rates[driver], accelerations[driver] = 3 * rng.normal(size=n), 5 * rng.normal(size=n)
    samples = mechanism.samples(at, None, None, rates, accelerations)
    return dataclasses.replace(samples, times=rng.uniform(0.0, 2.0, n))


def scalar(program, samples):
    """What Python's numbers say of the same samples."""
    mechanism = program.mechanism
    values, _ = mechanism._evaluate(program.plan, samples, "scalar")
    return Result(mechanism, program.plan, samples, values, "scalar", {"friction": "newton"})
