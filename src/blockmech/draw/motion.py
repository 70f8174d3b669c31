"""Where every link is at the samples of a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from blockmech.compiled import Compiled
from blockmech.ground.errors import RequestError
from blockmech.ground.tolerances import BLUR
from blockmech.model.laws_of_motion import OverRange
from blockmech.model.spots import Spot
from blockmech.model.structure import JointRef, LinkRef, Structure
from blockmech.result.quality import Quality
from blockmech.result.result import Result
from blockmech.typing import Arguments, Array, Coordinates, Data, Floats, Vectors


@dataclass(frozen=True)
class Motion:
    """Poses of all links at n samples of a run; NaN where the mechanism does not close.

    Attributes
    ----------
    result : the run that they come from
    samples : (n,) which samples of the run
    origin, axis : link -> complex (n,), origin [m] and unit x axis [-]
    q, q_rate : driver -> (n,) coordinate and rate
    quality : margins and gaps of the poses, at all samples of the run
    """

    result: Result
    samples: NDArray[np.intp]
    origin: Mapping[LinkRef, Vectors]
    axis: Mapping[LinkRef, Vectors]
    q: Mapping[str, Floats]
    q_rate: Mapping[str, Floats]
    quality: Quality

    @property
    def display(self) -> tuple[str, ...]:
        """Units in which it is shown."""
        return self.result._display

    @property
    def mechanism(self) -> Compiled:
        """What moves."""
        mechanism: Compiled = self.result.mechanism
        return mechanism

    @property
    def structure(self) -> Structure:
        """The mechanism's structure."""
        return self.mechanism.structure

    @property
    def time(self) -> Floats | None:
        """(n,) [s], where the run says times."""
        time = self.result._known_time()
        return None if time is None else np.asarray(time)[self.samples]

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """(n,) whether the whole mechanism closes."""
        return np.asarray(np.isfinite([*self.origin.values(), *self.axis.values()]).all(axis=0))

    @property
    def clearest(self) -> int:
        """The sample that is farthest from all dead centres."""
        margins = [*self.quality.margin.values(), self.feasible]
        return int(np.argmax(np.where(self.feasible, np.min(margins, axis=0), -1.0)))

    def to(self, *units: str) -> Motion:
        """The same, shown in other units; see `Result.to`."""
        return replace(self, result=self.result.to(*units))

    def only(self, samples: Sequence[int] | Array) -> Motion:
        """Some of the samples, in their order; indices or a mask (n,)."""
        rows: Data = {
            name: {key: row[samples] for key, row in getattr(self, name).items()}
            for name in ("origin", "axis", "q", "q_rate")
        }
        return replace(self, samples=self.samples[samples], **rows)

    def at(self, link: LinkRef, point: complex | Vectors) -> Vectors:
        """Places [m] of a point (n,), or of points (p, n), given in the link's frame."""
        offset: Vectors = self.axis[link] * np.asarray(point, complex)[..., None]
        return self.origin[link] + offset

    def in_frame(self, link: LinkRef, spot: Spot) -> Vectors:
        """Positions (n,) [m] of a point of another link in a link's frame."""
        return (self.at(*spot) - self.origin[link]) * np.conj(self.axis[link])

    def refuse(self) -> None:
        """Raise the error of a first pose that does not exist, as `Compiled.run` does."""
        at = {d: float(q[0]) for d, q in self.q.items()}
        want = [n for n in self.mechanism.outputs if n.endswith(".p")]
        rates = dict.fromkeys(at, 0.0)
        self.mechanism.run(at=at, rates=rates, want=want, friction="none", on_gap="raise")

    @cached_property
    def efforts(self) -> Mapping[str, tuple[Vectors, ...] | None]:
        """Forces [N] or couples [N m] (n,) of the loads at their terminals.

        None for a load that follows the time where the samples do not say it.
        """
        return {name: self._effort(name) for name in self.structure.elements}

    def _effort(self, element: str) -> tuple[Vectors, ...] | None:
        names = effort_names(self.structure, element)
        try:
            outputs = self.result._inside(*names)
        except RequestError:
            if self.time is not None:
                raise
            return None
        return tuple(np.asarray(outputs[name], dtype=complex)[self.samples] for name in names)

    @property
    def returns(self) -> bool:
        """Whether the last sample is the pose of the first, so that it can be played round."""
        origins = np.array([*self.origin.values()])
        size = float(np.abs(origins).max(initial=0.0)) or 1.0
        axes = np.array([*self.axis.values()])
        apart = [origins[:, -1] - origins[:, 0], size * (axes[:, -1] - axes[:, 0])]
        return bool(np.abs(apart).max() <= BLUR * size)


def effort_names(structure: Structure, element: str) -> list[str]:
    """The outputs that are an element's force or couple at each of its terminals."""
    return [
        f"{JointRef(element, name)}.{'force' if terminal.kind == 'point' else 'couple'}"
        for name, terminal in structure.elements[element].terminals.items()
    ]


def moves(mechanism: Compiled, at: Coordinates | None = None, samples: int | None = None) -> Motion:
    """Poses of a mechanism at driver coordinates ``at``, by default over the range of its laws.

    Where a driver has no law it is the one pose in which the drivers start.
    """
    if at is None:
        at = _starts(mechanism)
    rates = None
    if at is not None:
        samples = None
        # Laws by time do not say the rate at a coordinate, and a picture needs none.
        by_time = [d for d, law in mechanism.scene.drive.items() if not isinstance(law, OverRange)]
        rates = {d: 0.0 for d in by_time if d in mechanism.drivers} or None
    settings: Arguments = {"want": (), "on_gap": "mark", "friction": "none"}
    return moves_of_result(mechanism.run(at=at, samples=samples, rates=rates, **settings))


def moves_of_result(result: Result) -> Motion:
    """Poses at the samples of a run that was made before."""
    structure = result.mechanism.structure
    fixed = structure.frame_link
    moving = [link for link in structure.links if link != fixed]
    outputs = result._inside(
        *(f"{link}.{quantity}" for link in moving for quantity in ("p", "angle"))
    )
    origin = {link: outputs[f"{link}.p"] for link in moving}
    axis = {link: np.exp(1j * outputs[f"{link}.angle"]) for link in moving}
    q, rate = (
        {
            driver: np.asarray(result.samples.inputs[f"{quantity}_{i}"], dtype=float)
            for i, driver in enumerate(result.mechanism.drivers)
        }
        for quantity in ("q", "qd")
    )
    n = result.n
    origin, axis = {fixed: np.zeros(n, complex), **origin}, {fixed: np.ones(n, complex), **axis}
    return Motion(result, np.arange(n), origin, axis, q, rate, outputs.quality)


def _starts(mechanism: Compiled) -> dict[str, float] | None:
    """Where the drivers start, if laws do not give the range of all; else None."""
    scene = mechanism.scene
    if all(d in scene.drive for d in mechanism.drivers):
        return None
    return {d: scene.start_of(d)[0] for d in mechanism.drivers}
