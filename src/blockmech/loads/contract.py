"""What a load is: an element wired to markers, without links of its own.

An element declares its terminals and what it reads there; one kernel gives the
force or couple at each terminal. The force pass, the reduction pass, energies,
pictures and files all read that one declaration.

 1. A "point" terminal takes a force [N] at the wired marker, a "link" terminal a
    couple [N m] on the link of the wired marker.
 2. The kernel's parameters are named after what they read and at which terminal: ``p_a``
    is the place [m] of terminal a, ``v_a`` its velocity [m/s], ``e_a`` the unit x axis of
    its link [-], ``om_a`` the link's rate [rad/s]; the last one are the element's numbers.
 3. The kernel returns one force or couple per terminal. It obeys the rules of kernels.
 4. ``energy``, if there is one, is the stored energy [J]; it may read ``p`` and ``e`` only.
 5. A `Following` element has a law. Its arguments are the time, the coordinate and rate of a
    driver, or what kernels of the element measure; the law's value is one more argument of
    the element's kernel, before the numbers.
 6. What a method may use besides is declared, and nothing is lost but speed where it is not:
    `conservative` that the load has a potential, `kinks` where it is not smooth, `counted` which
    coordinate it follows, and after what it repeats.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, TypeAlias

from pydantic import (
    StrictBool,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_validator,
)

from blockmech.blocks.block import Block, Mistake, refuse
from blockmech.functions.pieces import Function
from blockmech.ground.errors import listed
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import Axis
from blockmech.loads.laws import AnyLaw
from blockmech.typing import Kernel, Record

Reads: TypeAlias = Mapping[str, tuple[str, ...]]
"""What is read at each terminal, or under the keys "driver", "time" and "law"."""

if TYPE_CHECKING:
    from blockmech.ground.values import Given

    LawGiven = Given[AnyLaw | Function, AnyLaw | Function | Record | Callable[..., Any]]
else:
    LawGiven = AnyLaw

LAW = "law"  # the port of an element whose law is a signal
POSITION_READS = ("p", "e")
VELOCITY_READS = ("v", "om")
MOVING_READS = (*VELOCITY_READS, "qd", "t", "signal")
VALID = "p_, v_, e_ or om_ before a terminal's name; then the law's value, if any, and the numbers"


@functools.cache
def read_by(kernel: Kernel) -> Reads:
    """What a kernel of an element reads, by the names of its parameters; see rule 2.

    Raises `TypeError` for a name that says nothing which can be read.
    """
    reads: dict[str, tuple[str, ...]] = {}
    for name in inspect.signature(kernel).parameters:
        quantity, _, terminal = name.partition("_")
        if terminal and quantity not in (*POSITION_READS, *VELOCITY_READS):
            raise _unreadable(kernel, name)
        if terminal:
            reads[terminal] = (*reads.get(terminal, ()), quantity)
    return reads


def _unreadable(kernel: Kernel, name: str) -> TypeError:
    where = f"{kernel.__module__}.{kernel.__qualname__}"
    return TypeError(f"{where}: its parameter {name!r} names nothing that can be read. {VALID}")


def acts(x: object) -> bool:
    """Whether a number is not zero; of many designs, (m, 1), whether one's is not.

    A number that is not known yet, as that of a trace, may be any.
    """
    return bool(x.any()) if hasattr(x, "any") else bool(x) if isinstance(x, int | float) else True


class Kinks(NamedTuple):
    """Where a load is not smooth in place.

    measure : kernel of what the element measures, of positions and its numbers
    values : of that measure, at which there is a kink
    turning : whether the measure is an angle in (-pi, pi], which jumps at the half turn
    """

    measure: Kernel
    values: Sequence[float]
    turning: bool = False


class Counted(NamedTuple):
    """A coordinate that counts turns, and which a load follows.

    driver : its name, "" where that is not known
    period : [rad] after which the load repeats, 0 where it does not
    """

    driver: str
    period: float


@dataclass(frozen=True)
class Terminal:
    """Where an element takes hold: at a marker's point, or on a marker's link."""

    kind: Literal["point", "link"]

    @property
    def unit(self) -> str:
        """Unit of what the element gives there."""
        return "N" if self.kind == "point" else "N m"


class Element(Block):
    """A load between links: force, couple, spring ... ``useful`` marks a work load."""

    _called: ClassVar[str] = "a load such as Force(force=(30.0, 0.0))"
    terminals: ClassVar[Mapping[str, Terminal]] = {}

    useful: StrictBool = False

    def __init_subclass__(cls, **settings: Any) -> None:
        """Hold the kernels that the class names against rule 2."""
        super().__init_subclass__(**settings)
        for method in ("kernel", "measure_kernel", "energy"):
            if not inspect.isfunction(vars(cls).get(method)):
                continue
            named = inspect.getclosurevars(vars(cls)[method])
            for function in filter(
                inspect.isfunction, (*named.globals.values(), *named.nonlocals.values())
            ):
                parameters = inspect.signature(function).parameters
                if any(name.partition("_")[2] in cls.terminals for name in parameters):
                    cls._check_terminals(function, read_by(function))

    @classmethod
    def _check_terminals(cls, kernel: Kernel, reads: Reads) -> None:
        """Raise `TypeError` where something is read at a terminal that there is not."""
        for terminal, quantities in reads.items():
            if terminal not in (*cls.terminals, "driver", "time", LAW):
                raise _unreadable(kernel, f"{quantities[0]}_{terminal}")

    def model_post_init(self, context: object, /) -> None:
        """Check the kernels against rule 2, those of base classes included."""
        super().model_post_init(context)
        self._check_terminals(self.kernel(), self.reads())

    def reads(self) -> Reads:
        """What it depends on, at each terminal."""
        return read_by(self.kernel())

    def kernel(self) -> Kernel:
        """The function that gives the force or couple at each terminal; see rule 3."""
        raise TypeError(f"{type(self).__name__} declares no kernel")

    def energy(self) -> Kernel | None:
        """The stored energy, or None; see rule 4."""
        return None

    @property
    def line(self) -> tuple[Kernel, Kernel] | None:
        """Of a load along a line its length, and its tension by the force at the first terminal."""
        return None

    @property
    def link_vectors(self) -> tuple[str, ...]:
        """Its parameters that are vectors in the axes of the first terminal's link."""
        return ()

    @property
    def conservative(self) -> bool:
        """Whether its force derives from `energy` alone: then it reads no velocities."""
        return self.energy() is not None and not self.reads_any(*MOVING_READS)

    def kinks(self) -> Kinks | None:
        """Values of its own coordinate at which it is not smooth; None if there are none."""
        return None

    @property
    def counted(self) -> Counted | None:
        """The turn-counting coordinate on which it depends; None if the pose determines it."""
        return None

    def reads_any(self, *quantities: str) -> bool:
        """Whether it reads one of these quantities."""
        return any(not {*quantities}.isdisjoint(names) for names in self.reads().values())


class Following(Element):
    """An element whose force or moment follows a law.

    ``law`` is typed data, in Python also a function of ``coordinate``, ``rate`` or ``time``,
    by the names of its parameters. ``driver`` names the driving link whose coordinate or
    rate is the law's argument; without it that is the element's own, see `measure_kernel`;
    ``coordinate_text`` describes that coordinate, its zero and its sense in words;
    ``coordinate_symbol`` is its symbol in pictures.
    """

    coordinate_text: ClassVar[str] = ""
    turning: ClassVar[bool] = False  # whether that is an angle in (-pi, pi]
    coordinate_symbol: ClassVar[str] = ""
    refers: ClassVar[tuple[str, ...]] = ("driver",)

    law: LawGiven | None
    driver: str | None = None

    def variables(self) -> tuple[str, ...]:
        """What the law is a function of; nothing without a law."""
        return () if self.law is None else self.law.variables()

    def axis(self, outside: Axis) -> Axis:
        """Units of the law: its value's, and those of the driver's or its own coordinate."""
        axis = Axis.of("P" if next(iter(self.terminals.values())).kind == "point" else "R")
        return axis._replace(coordinate=outside.known.get(self.driver or "", axis).coordinate)

    @field_validator("law", mode="wrap")
    @classmethod
    def _data_or_function(cls, raw: Any, read: ValidatorFunctionWrapHandler) -> Any:
        if isinstance(raw, Function):
            return raw
        return Function.of_call(raw) if callable(raw) and not isinstance(raw, type) else read(raw)

    @model_validator(mode="after")
    def _check_driver(self) -> Following:
        of = self.variables()
        if self.driver is not None and not {"coordinate", "rate"} & set(of):
            message = f"is useless: the law is {f'of {listed(of)}' if of else 'constant'}"
            lines: list[Mistake] = [(("driver",), mistake("wrong-value", message, "", "remove it"))]
            refuse(type(self).__name__, lines)
        return self

    def reads(self) -> Reads:
        """All that it depends on: what its kernel reads and what its law measures."""
        reads_of = dict(read_by(self.kernel()))
        for _, reads in self.measures():
            for key, quantities in reads.items():
                reads_of[key] = tuple(dict.fromkeys((*reads_of.get(key, ()), *quantities)))
        return reads_of

    @property
    def conservative(self) -> bool:
        """False: whether a law has a potential is not known."""
        return False

    def kinks(self) -> Kinks | None:
        """Kinks of a law of the element's own coordinate."""
        if self.law is None or self.driver is not None or "coordinate" not in self.variables():
            return None
        values = self.law.kinks_of_angle() if self.turning else self.law.rows()
        return Kinks(self.measure_kernel(rate=False), values, self.turning) if values else None

    @property
    def counted(self) -> Counted | None:
        """The coordinate of the driver, or any that a signal may depend on."""
        if "signal" in self.variables():
            return Counted("", 0.0)
        if self.law is None or self.driver is None or "coordinate" not in self.variables():
            return None
        return Counted(self.driver, self.law.whole)

    @property
    def ports(self) -> tuple[str, ...]:
        """Signal ports: the law's, if that is a signal."""
        return (LAW,) if "signal" in self.variables() else ()

    def measure_kernel(self, rate: bool) -> Kernel:
        """Kernel of the element's own coordinate or rate."""
        raise TypeError(f"{type(self).__name__} declares no measure of its own")

    def function(self) -> str:
        """Symbol of the law in pictures, ``f(crank.q)``; "" for a constant."""
        symbols = {"time": "t", "signal": "signal", "coordinate": self.coordinate_symbol}
        symbols["rate"] = f"rate of {self.coordinate_symbol}"
        of = {"coordinate": "q", "rate": "rate"} if self.driver else {}
        arguments = [f"{self.driver}.{of[x]}" if x in of else symbols[x] for x in self.variables()]
        return f"f({', '.join(arguments)})" if arguments else ""

    def measures(self) -> Iterator[tuple[Kernel | None, Reads]]:
        """Kernel and inputs of each argument of the law; no kernel where it is an input."""
        for argument in self.variables():
            if argument == "time":
                yield None, {"time": ("t",)}
            elif argument == "signal":
                yield None, {LAW: ("signal",)}
            elif self.driver is not None:
                yield None, {"driver": ("qd" if argument == "rate" else "q",)}
            else:
                measure = self.measure_kernel(argument == "rate")
                yield measure, read_by(measure)
