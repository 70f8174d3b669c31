"""The trade of a sweep: precisions, engines and friction methods.

Source of the methods compared: [R10] steps 1-5 (single, successive); Newton's method
and the precisions are blockmech's own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from blockmech.analysis.reference_errors import (
    LONG,
    MOST_ITERATIONS,
    UNSURE,
    WIDER,
    ReferenceErrors,
    comparable,
    compared,
    reference_errors,
    unsure_samples,
)
from blockmech.analysis.trade.measure import USELESS, Question, Reference, Setting
from blockmech.analysis.trade.rotated import rotated_run
from blockmech.compiled import Compiled
from blockmech.ground.errors import listed, refused
from blockmech.ground.runnable import EVERYTHING
from blockmech.ground.tolerances import HALVINGS
from blockmech.result.result import Result
from blockmech.typing import Arguments, Data, Successive

NUMPY = {"engine": "numpy"}
SINGLE = NUMPY | {"precision": "complex64"}
WIDEST = NUMPY | {"precision": "clongdouble"}
SETTLED = 2 * HALVINGS  # successive iterations of the check: P^52 is rounding wherever P < 0.5

ENGINES: Mapping[str, Data] = {
    "": NUMPY,
    " llvm": {"engine": "llvm"},
}  # how methods of friction are called by each

PLAIN = (
    Setting("llvm", "complex128", ENGINES[" llvm"]),
    Setting("numpy", "complex64", SINGLE),
    Setting("numpy", "complex128", NUMPY),
    *((Setting("numpy", "clongdouble", WIDEST),) * WIDER),
    Setting("scalar", "complex128", {"engine": "scalar"}),
)
FRICTIONS = tuple(
    Setting(f"{method}{name}", setting, {**engine, **options})
    for name, engine in ENGINES.items()
    for method, setting, options in (
        ("friction none", "", {"friction": "none"}),
        *(() if name else (("friction none", "complex64", SINGLE | {"friction": "none"}),)),
        ("friction single", "", {"friction": "single"}),
        *(
            ("successive", f"{k} iterations", {"friction": Successive(iterations=k)})
            for k in range(2, MOST_ITERATIONS + 1)
        ),
        ("successive as set", "", {"friction": "successive"}),
    )
)


class Sweep(Question):
    """A run at given samples."""

    MEASURE = (
        "largest error of any output at any sample, relative to the output's largest magnitude "
        "(angles in rad)"
    )
    COUNTED = (
        "kernel calls and iterations of the friction equations, over all samples; continuation "
        "is not counted"
    )

    def __init__(
        self, mechanism: Compiled, want: tuple[str, ...] | None, request: Arguments
    ) -> None:
        self.mechanism = mechanism
        self.request = {**request, "want": want or EVERYTHING, "on_gap": "mark"}
        best = self.run(WIDEST)
        names = tuple(best) if len(best) <= 3 else (f"{len(best)} outputs",)
        self.asked = f"run: {', '.join(names)} at {best.n} samples"
        self.rubs = bool(best._plan.reports["friction"])
        self.errors, self.reference = self._referred(best)
        self.notes = tuple(self._left_out(best))
        if want is None and self.rubs and (own := self._of_friction()):
            self.errors = self.errors.without((*self.errors.left_out, *own))
            why = "compared only where asked for, as friction alone makes them"
            self.notes += (f"{why}: {listed(own, 3)}",)
        self.notes += tuple(self._single_precision())

    def settings(self) -> Iterator[Setting]:
        """Precisions, friction methods where joints have friction, and the scalar engine."""
        yield from PLAIN[:3]
        if self.rubs:
            yield from FRICTIONS
        yield from PLAIN[3:]

    def run(self, options: Arguments, seconds: float = 0.0) -> Result:
        """The sweep with a setting; gaps are NaN. One batch cannot be stopped."""
        return self.mechanism.run(**self.request, **options)

    def evaluations(self, result: Result) -> int:
        """Kernel calls and iterations of the friction equations over all samples of a run.

        Newton's method starts from two successive approximations, which count as well.
        """
        before = 2 if result.settings["friction"] == "newton" else 0
        steps = [np.asarray(k) for k in result.quality.iterations.values()]
        count: int = result.n * result._plan.calls
        return count + sum(int(np.sum(k + before * (k > 0))) for k in steps)

    def error(self, result: Result) -> tuple[float, str]:
        """The largest relative error over the compared outputs and samples, and of which."""
        return self.errors.worst(result)

    def _referred(self, best: Result) -> tuple[ReferenceErrors, Reference]:
        """The reference: in the widest precision, checked by the rotated mechanism.

        With friction the check also solves by successive approximation in place of Newton's
        method, wherever that is sure to converge.
        """
        good = comparable(best, self.rubs)
        if not good.any():
            found, code = "no sample has an answer", "nothing-to-compare"
            raise refused("trade", found, "see limits", code=code)
        how: Arguments = {"static": self.request.get("static", False)}
        solver = ", Newton's method" if self.rubs else ""
        bounds = [float(np.max(c[good])) for c in best.quality.contraction.values()]
        checked = solver
        if self.rubs and max(bounds, default=0.0) < 0.5:
            how["friction"] = Successive(iterations=SETTLED)
            checked = f", {SETTLED} successive approximations"
        want = {"want": tuple(best)}
        check = rotated_run(self.mechanism, best.samples, "clongdouble", want | how)
        errors = reference_errors(best, check, good)
        floor = max(errors.error(check), LONG)
        if len(errors.left_out) > len(errors.values):
            floor = USELESS  # what the two differ on is no rounding: nothing can be confirmed
        digits = "80-bit or wider" if WIDER else "double"
        return errors, Reference(
            f"{digits} floating point{solver}",
            f"the mechanism rotated in the plane{checked}",
            floor,
        )

    def _left_out(self, best: Result) -> Iterator[str]:
        """What is not compared, and why."""
        for why, count in Counter(unsure_samples(best, self.rubs).values()).items():
            yield f"not compared: {count} samples, {why}"
        judged = set(compared(best))
        for names, why in (
            ([n for n in best if n not in judged], "they divide by what may vanish"),
            (self.errors.left_out, "rounding alone decides them"),
        ):
            if names:
                yield f"not compared, as {why}: {listed(names, 3)}"

    def _of_friction(self) -> tuple[str, ...]:
        """What friction alone makes: without friction it is wrong by all of itself."""
        without = self.run(NUMPY | {"friction": "none"})
        values = self.errors.values
        return tuple(n for n, x in values.items() if np.any(x) and not np.any(without[n]))

    def _single_precision(self) -> Iterator[str]:
        """The margin down to which single precision is of use, in a sentence."""
        result, good = self.run(SINGLE), self.errors.good
        margins = [np.asarray(m, dtype=float) for m in result.quality.margin.values()]
        errors = [e for e in self.errors.each(result).values() if len(e) == result.n]
        if not margins or not errors:
            return
        margin, error = np.min(margins, axis=0)[good], np.max(errors, axis=0)[good]
        bad = margin[error > UNSURE]
        judgement = (
            f"stops being usable (error above {UNSURE:g}) below a margin of {bad.max():.1g}"
            if bad.size
            else f"is usable down to the smallest margin met, {margin.min():.2g}"
        )
        yield f"single precision, worst error {error.max():.1g}: it {judgement}"
