"""What can be run: a graph, a linkage or a compiled mechanism, with one declaration of a run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from importlib import import_module
from types import MethodType
from typing import TYPE_CHECKING, Any, Generic

from blockmech.typing import Coordinates, EngineName, FrictionMethod, M, Numbers, OnGap, Precision

if TYPE_CHECKING:
    from blockmech.result import Result

EVERYTHING = ("*",)


class Runnable(ABC, Generic[M]):
    """What can be compiled, and so be run."""

    called = "a graph, a linkage or a mechanism"
    instead = "run it first: its run() gives a result"

    @abstractmethod
    def compile(self) -> M:
        """The mechanism that computes."""

    def run(
        self,
        at: Coordinates | None = None,
        *,
        samples: int | None = None,
        times: Numbers | None = None,
        rates: Coordinates | None = None,
        accelerations: Coordinates | None = None,
        want: Iterable[str] | str = EVERYTHING,
        friction: FrictionMethod | None = None,
        tolerance: float | None = None,
        iterations: int | None = None,
        accuracy: float | None = None,
        static: bool = False,
        engine: EngineName = "auto",
        precision: Precision | None = None,
        chunk: int | None = None,
        on_gap: OnGap = "raise",
    ) -> Result[M]:
        """Compute the wanted outputs at given driver coordinates or times.

        Parameters
        ----------
        at : float or (n,) [rad or m], or a mapping driver -> (n,)
            Driver coordinates; rates follow from the scene's law of motion.
        samples : int
            That many equally spaced samples of the law's range; default 361.
        times : (n,) [s]
            Samples of the laws of motion by time.
        rates, accelerations : like ``at``
            Driver rates [rad/s or m/s] and accelerations, in place of the law's.
        want : names or patterns of outputs, e.g. ``["crank.drive", "*.reaction"]``; default all
        friction : "none" | "single" | "successive" | "newton" (default)
        tolerance : float [N], stop of ``successive``; default 1e-7 of the largest reaction
        iterations : int, fixed number of iterations of ``successive``
        accuracy : float [- or rad]
            Wanted error relative to each output's largest magnitude; chooses friction
            method, iterations and precision, and ``result.accuracy`` says which.
        static : without inertia
        engine : "scalar" for few samples, "numpy" for batches, "llvm" for machine code that is
            compiled at the first run (extra ``fast``), "auto" by size; "auto" takes "llvm" from
            a million samples on, and for a request that has been compiled before
        precision : "complex64" | "complex128" (default) | "clongdouble" (NumPy engine)
        chunk : samples per batch of the NumPy engine
        on_gap : what to do at samples without an answer: raise, mark them as NaN,
            or stop before the first

        Returns
        -------
        Result, labelled, with units and quality

        Raises
        ------
        GraphError with all problems of a graph or linkage that is no mechanism
        RequestError for unknown names or settings that do not fit
        AssemblyError, SingularError, FrictionError at gaps, unless marked
        """
        mechanism: Any = self.compile()
        taken = mechanism.samples(at, samples, times, rates, accelerations)
        given = {"friction": friction, "tolerance": tolerance, "iterations": iterations}
        given["static"] = static
        result: Result[M] = mechanism.answer(
            taken, want, given, accuracy, engine, precision, chunk, on_gap
        )
        return result


class LazyMethod:
    """A method that is a function of a lower file, loaded when it is first asked for.

    So the function is declared once: `help`, type checkers and calls read the same.
    """

    def __init__(self, module: str) -> None:
        self.module = module

    def __set_name__(self, owner: type, name: str) -> None:
        self.owner, self.name = owner, name

    def __get__(self, instance: Any, owner: type) -> Any:
        function = getattr(import_module(self.module), self.name)
        setattr(self.owner, self.name, function)
        return function if instance is None else MethodType(function, instance)
