"""What a friction law is: how a pair resists slip, by the load on it and the speed.

A law declares its numbers and one kernel. With g [N] the load on the pair (the reaction of a
revolute pair, max(|N|, 2 |C| / guide length) of a prismatic one) the friction on the later link is

    t = -sgn(slip) (factor g + drag)            while the pair slips
    |t| <= factor g + drag, both at rest        while it does not

 1. The kernel is ``kernel(speed, p)``, or ``kernel(p)`` of a law that does not ask for the speed,
    and returns `FrictionTerms`: factor [m] of a revolute pair or [-] of a prismatic one, and drag
    [N m] or [N]. ``speed`` >= 0 is the magnitude of the relative rate [rad/s] or [m/s], ``p`` the
    law's numbers. It obeys the rules of kernels: primitives of `ground.plane` alone, no branch
    on a number, NaN in, NaN out.
 2. Neither factor nor drag is negative: friction does not drive.
 3. At rest the kernel counts at speed 0, unless ``kernel_at_rest`` gives another one, of ``p``.
 4. ``drags`` is False where the drag is 0.0 at all speeds; then it is not computed.
 5. ``smooth`` is False where factor or drag are not analytic in the speed, from 0 on: where they
    have a kink, or go with a fractional power. Motions are then integrated in time.
 6. A law that follows the load otherwise than in proportion reads it: its kernel is
    ``kernel(speed, load, p)`` with ``load`` [N] >= 0, and says the tangent there, factor the
    slope and drag what is left of its friction. At rest it is a factor, to which friction of any
    load tends as the speed falls or the load grows; ``p.steepest`` is the largest magnitude of the
    slope, at any speed and load, from which the certificate is.
 7. A law does not depend on where the pair is, nor on the time.
 8. A law that ``remembers`` has a state of its own, the deflection z [rad] or [m] of the pair
    before it slips, 0 where it was never loaded. Its kernel is ``kernel(slip, deflection, p)`` of
    the rate with its sign, and friction is -(factor g + drag) in either sense. ``rate_kernel``
    gives dz/dt, of the same arguments, and ``steady_kernel`` the z, of ``(slip, p)``, at which
    that is zero. Its friction may drive for a while, by what the deflection stores: with dz/dt
    the elastic part of it, that at slip 0, is the power that goes there. Rules 2, 4 and 5 are
    of the friction that is left when it has slipped at one rate for long.

Solvers, motion, `verify`, pictures and derivatives ask this one kernel.

Sources: [R10] Ruiz, Durango & Calle 2010, Eqs. 8-10 (friction by the load); each law names its own.
"""

from __future__ import annotations

import functools
import inspect
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationError
from pydantic_core import InitErrorDetails, core_schema

from blockmech.ground.errors import close_match, listed, shown
from blockmech.ground.plane import has_arithmetic
from blockmech.ground.registry import Registry
from blockmech.ground.validation_errors import mistake
from blockmech.ground.values import StrictModel
from blockmech.typing import Data, Kernel, Parameters, Real

LAWS = Registry("friction law", code="unknown-friction-law")
"""Every friction law by the name that files give it."""

PLAIN = "coulomb"  # the law of data that name none
SPEED, LOAD = "speed", "load"  # what a kernel may read besides the law's numbers
SLIP, DEFLECTION = "slip", "deflection"  # what that of a law with a state reads


class FrictionTerms(NamedTuple):
    """How a pair resists: friction is ``factor`` times the load on the pair, and ``drag``."""

    factor: Real  # [m] of a revolute pair, [-] of a prismatic one
    drag: Real  # [N m] of a revolute pair, [N] of a prismatic one


class FrictionLaw(StrictModel):
    """Friction of one pair.

    kinds : the pairs that may have it, "R" and "P"
    drags : whether a part of it is independent of the load, see rule 4 remembers : whether the law
    has a state, see rule 8

    >>> issubclass(bm.friction.Coulomb, bm.friction.FrictionLaw)
    True
    """

    kind_key: ClassVar[str] = "law"
    plain_kind: ClassVar[str] = PLAIN
    _called: ClassVar[str] = (
        "a friction law such as bm.friction.Coulomb(coefficient=0.1, radius=0.01)"
    )
    type_name: ClassVar[str] = ""
    kinds: ClassVar[tuple[str, ...]] = ("R", "P")
    drags: ClassVar[bool] = True
    remembers: ClassVar[bool] = False

    @classmethod
    def __pydantic_init_subclass__(cls, **more: Any) -> None:
        """Register a law under the name that it declares: ``law: Literal["name"] = "name"``."""
        super().__pydantic_init_subclass__(**more)
        named = cls.model_fields.get("law")
        if named is not None and isinstance(named.default, str):
            LAWS.register(named.default, cls)

    def model_post_init(self, context: Any, /) -> None:
        """Hold the kernels against rule 1."""
        super().model_post_init(context)
        _check(self.kernel_at_rest(), [()])
        if self.remembers:
            _check(self.kernel(), [(SLIP, DEFLECTION)])
            _check(self.rate_kernel(), [(SLIP, DEFLECTION)])
            _check(self.steady_kernel(), [(SLIP,)])
        else:
            _check(self.kernel(), [(SPEED,), (), (SPEED, LOAD)])

    def kernel(self) -> Callable[..., FrictionTerms]:
        """The function of rule 1."""
        raise TypeError(f"{type(self).__name__} declares no kernel")

    def kernel_at_rest(self) -> Callable[..., FrictionTerms] | None:
        """The function of rule 3, or None."""
        return None

    def rate_kernel(self) -> Callable[..., Real]:
        """dz/dt of rule 8, for laws that remember."""
        raise TypeError(f"{type(self).__name__} declares no rate of its state")

    def steady_kernel(self) -> Callable[..., Real]:
        """z of rule 8 at a steady rate, for laws that remember."""
        raise TypeError(f"{type(self).__name__} declares no steady state")

    @property
    def smooth(self) -> bool:
        """See rule 5."""
        return True

    @property
    def reads_speed(self) -> bool:
        """Whether friction depends on the speed."""
        return SPEED in _read(self.kernel())

    @property
    def reads_load(self) -> bool:
        """Whether friction is not linear in the load, see rule 6."""
        return LOAD in _read(self.kernel())

    def numbers(self) -> Data:
        """The parameters of the law, by name."""
        fields = ((name, getattr(self, name)) for name in type(self).model_fields)
        return {name: float(x) if isinstance(x, int) else x for name, x in fields if _is_number(x)}

    def parameters(self) -> Parameters:
        """The parameters of the law as ``p``, the named tuple of its kernels."""
        numbers = self.numbers()
        return _record(type(self).__name__ + "Numbers", tuple(numbers))(*numbers.values())

    def at(self, speed: float, load: float = 0.0) -> FrictionTerms:
        """Factor and drag of a pair that slips steadily at a speed [rad/s or m/s].

        ``load`` [N] matters for laws that are not linear in it.

        >>> from blockmech.friction import Stribeck
        >>> law = Stribeck(static=0.3, kinetic=0.2, stribeck_speed=0.5, radius=0.05)
        >>> round(law.at(0.5).factor / 0.05, 6)
        0.236788
        """
        terms: FrictionTerms = self.sliding()(speed, load)
        return terms

    def sliding(self, bind: Callable[[Kernel], Kernel] = lambda kernel: kernel) -> Kernel:
        """The function behind `at`, for numbers of any type that ``bind`` supports."""
        kernel, p = bind(self.kernel()), self.parameters()
        if self.remembers:
            steady = bind(self.steady_kernel())
            return lambda speed, load=0.0: kernel(speed, steady(speed, p), p)
        read = self.reads_speed + self.reads_load
        return lambda speed, load=0.0: kernel(*(speed, load)[:read], p)

    def at_rest(self) -> FrictionTerms:
        """Factor and drag of the largest friction of a pair at rest."""
        kernel = self.kernel_at_rest()
        return self.at(0.0) if kernel is None else kernel(self.parameters())

    @property
    def acts(self) -> bool:
        """Whether there is any friction."""
        return any(map(bool, (*self.at(1.0), *self.at_rest())))

    @property
    def edge_distance(self) -> float | None:
        """Length [m] of the guide, whose two edges carry a couple; None where N alone counts."""
        return getattr(self, "guide_length", None)

    def check_for(self, kind: str, joint: str) -> None:
        """Refuse a law that does not fit the kind of pair."""
        if kind not in self.kinds:
            words = {"R": "revolute", "P": "prismatic"}
            found = f"{joint} is {words[kind]}"
            valid = f'"{self.type_name}" is for {words[self.kinds[0]]} pairs'
            fit = [name for name in LAWS if kind in LAWS[name].kinds]
            raise mistake("friction-mismatch", found, valid, f"laws for it: {listed(fit)}")


@functools.lru_cache
def _read(kernel: Kernel) -> tuple[str, ...]:
    """What a kernel reads, by the names of its arguments."""
    return tuple(inspect.signature(kernel).parameters)


def _check(kernel: Kernel | None, readable: Sequence[tuple[str, ...]]) -> None:
    """Raise `TypeError` for a kernel that reads, before the law's numbers, what is not there."""
    names = _read(kernel) if kernel is not None else ("p",)
    if names[:-1] not in readable or not names:
        where = f"{kernel.__module__}.{kernel.__qualname__}" if kernel else ""
        fit = " or ".join(f"({', '.join((*x, 'p'))})" for x in readable)
        raise TypeError(f"{where}: a kernel of a friction law takes {fit}, not {names}")


def _is_number(x: object) -> bool:
    return (
        isinstance(x, int | float | np.floating | np.integer) and not isinstance(x, bool)
    ) or has_arithmetic(x)


@functools.cache
def _record(name: str, fields: tuple[str, ...]) -> Any:
    return namedtuple(name, fields)  # the fields are known at run time only


# -- a field of a model that holds one ---------------------------------------------------------


def read_law(raw: Any) -> FrictionLaw:
    """A friction law from what a file says of it, or one that is made already."""
    if isinstance(raw, FrictionLaw):
        return raw
    if not isinstance(raw, Mapping):
        remedy = 'write {"law": "coulomb", ...}; laws: ' + listed(LAWS)
        raise mistake("wrong-type", f"must be an object {{...}}, got {shown(raw)}", "", remedy)
    name = raw.get("law", PLAIN)
    cls = LAWS.get(name) if isinstance(name, str) else None
    if cls is None:
        remedy = close_match(name, LAWS) if isinstance(name, str) else ""
        found, valid = f"no friction law {shown(name)}", f"laws: {listed(LAWS, 30)}"
        wrong = mistake("unknown-friction-law", found, valid, remedy)
        line = InitErrorDetails(type=wrong, loc=("law",), input=name)
        raise ValidationError.from_exception_data("friction", [line])
    law: FrictionLaw = cls.model_validate(raw)
    return law


class _Registered:
    """A field that holds a friction law of any name that is registered."""

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(read_law)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> Data:
        inner: Any = handler  # laws may be registered after a model that holds one is built
        mapping = {}
        for name in LAWS:
            LAWS[name].model_rebuild()
            inner_schema = inner.generate_json_schema.generate_inner(
                LAWS[name].__pydantic_core_schema__
            )
            mapping[name] = inner_schema["$ref"]
        choice = {"propertyName": "law", "mapping": mapping}
        return {"oneOf": [{"$ref": ref} for ref in mapping.values()], "discriminator": choice}


if TYPE_CHECKING:
    AnyFriction: TypeAlias = FrictionLaw
else:
    AnyFriction = Annotated[FrictionLaw, _Registered]
