"""Where every link is at the samples of a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.compiled import Compiled
from blockmech.errors import Problem, RequestError
from blockmech.model.structure import JointRef, LinkRef, MarkerRef, Structure
from blockmech.result import Result

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
SAME_POSE = 1e-6  # [-] of the mechanism's size, and [rad]: far below a line's width


class Spot(NamedTuple):
    """A place on a link, in the link's frame [m]."""

    link: LinkRef
    at: complex


@dataclass(frozen=True)
class Motion:
    """Poses of all links at n samples; NaN where the mechanism cannot close.

    Attributes
    ----------
    origin, axis : link -> complex (n,), origin [m] and unit x axis [-]
    q, q_rate : driver -> (n,) coordinate and rate
    result : the run that they come from
    """

    mechanism: Compiled
    origin: Mapping[LinkRef, Complex]
    axis: Mapping[LinkRef, Complex]
    q: Mapping[str, Real]
    q_rate: Mapping[str, Real]
    result: Result

    @property
    def structure(self) -> Structure:
        """The mechanism's structure."""
        return self.mechanism.structure

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.result.n

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """(n,) whether the whole mechanism closes."""
        found: NDArray[np.bool_] = np.isfinite([*self.origin.values(), *self.axis.values()])
        return np.asarray(found.all(axis=0))

    def at(self, link: LinkRef, place: complex) -> Complex:
        """Places (n,) [m] of a point of a link, given in the link's frame."""
        return self.origin[link] + self.axis[link] * place

    def seen(self, link: LinkRef, spot: Spot) -> Complex:
        """Places (n,) [m] of a spot of another link in a link's frame."""
        return (self.at(*spot) - self.origin[link]) * np.conj(self.axis[link])

    def seen_once(self, link: LinkRef, spot: Spot) -> complex:
        """The same at a sample where both are known."""
        z = self.seen(link, spot)
        known = z[np.isfinite(z)]
        return complex(known[0]) if len(known) else 0j

    def refuse(self, k: int) -> None:
        """Raise the error of a pose that cannot be reached, in the words of `Compiled.run`."""
        at = {d: float(q[k]) for d, q in self.q.items()}
        want = [n for n in self.mechanism.outputs if n.endswith(".p")]
        rates = dict.fromkeys(at, 0.0)
        self.mechanism.run(at=at, rates=rates, want=want, friction="none", on_gap="raise")

    def efforts(self, element: str) -> tuple[Complex, ...] | None:
        """Forces [N] or couples [N m] (n,) of a load at its terminals.

        None where the load follows the time and the samples do not say it.
        """
        terminals = self.structure.elements[element].terminals
        wanted = [
            f"{JointRef(element, name)}.{'force' if terminal.kind == 'point' else 'couple'}"
            for name, terminal in terminals.items()
        ]
        try:
            found = self.result.inside(*wanted)
        except RequestError:
            if self.result.known_time() is not None:
                raise
            return None
        return tuple(np.asarray(found[name], dtype=complex) for name in wanted)

    def closes(self, first: int, last: int) -> bool:
        """Whether two samples are the same pose, so that the motion can be played round."""
        places = np.array([*self.origin.values()])
        size = float(np.nanmax(np.abs(places), initial=0.0)) or 1.0
        steps = np.abs(places[:, last] - places[:, first]) / size
        turns = [abs(e[last] - e[first]) for e in self.axis.values()]
        return bool(max([*steps, *turns]) <= SAME_POSE)


def marker_place(structure: Structure, ref: MarkerRef) -> complex:
    """Place [m] of a marker in the frame of its link."""
    return structure.block(ref.block).place_of(structure.marker(ref))


def moves(mechanism: Compiled, at: Any = None, **samples: Any) -> Motion:
    """Poses of a mechanism at driver coordinates ``at``, or over the range of its laws.

    ``samples`` are those of `Compiled.run`: ``samples=`` or ``times=``. Raises
    `RequestError` where neither ``at`` nor the scene says where the drivers are.
    """
    if at is None and samples.get("times") is None:
        at = _starts(mechanism)
        samples = samples if at is None else {}
    if at is not None:
        # Laws by time do not say the rate at a coordinate, and a picture needs none.
        rates = {
            d: 0.0
            for d, law in mechanism.scene.drive.items()
            if not law.by_coordinate and d in mechanism.drivers
        }
        samples["rates"] = rates or None
    return moves_of_result(mechanism.run(at=at, want=(), on_gap="mark", friction="none", **samples))


def moves_of_result(result: Result) -> Motion:
    """Poses at the samples of a run that was made before."""
    mechanism = result.mechanism
    s, fixed = mechanism.structure, mechanism.structure.frame_link
    moving = [link for link in s.links if link != fixed]
    found = result.inside(*(f"{link}.{what}" for link in moving for what in ("p", "angle")))
    origin = {fixed: np.zeros(found.n, complex)}
    axis = {fixed: np.ones(found.n, complex)}
    for link in moving:
        origin[link] = found[f"{link}.p"]
        axis[link] = np.exp(1j * found[f"{link}.angle"])
    q, qd = (
        {d: np.asarray(result.samples.inputs[f"{what}_{i}"], dtype=float)
         for i, d in enumerate(mechanism.drivers)}
        for what in ("q", "qd")
    )  # fmt: skip
    return Motion(mechanism, origin, axis, q, qd, result)


def _starts(mechanism: Compiled) -> dict[str, float] | None:
    """Where a free motion starts, if laws do not give the drivers' ranges; else None."""
    laws, starts = mechanism.scene.drive, mechanism.scene.initial
    missing = [d for d in mechanism.drivers if d not in laws]
    if missing and all(d in starts for d in mechanism.drivers):
        return {d: starts[d].q for d in mechanism.drivers}
    if missing:
        raise RequestError(
            Problem(
                "no-range",
                mechanism.scene.address("drive", d),
                f"the range of driver {d} is not known",
                "a picture of the motion needs a law of motion for every driver",
                f'give one, e.g. drive("{d}", ConstantRate(rate=1.0)), or name poses with at=',
            )
            for d in missing
        )
    return None
