"""Outputs along a motion over several charts: each leg is read in its own, by the user's names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.dynamics.motion_outputs import SimulationResult, result_along
from blockmech.motion import Floats, Motion
from blockmech.quality import Flag, Quality
from blockmech.result import FREE
from blockmech.samples import Samples
from blockmech.settings import friction_asked
from blockmech.typing import M

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from blockmech.compiled import Compiled
    from blockmech.dynamics.atlas import Leg

IDLE = ("drive", "drive_by_reduction", "power")  # of a driver that is free
OF_COORDINATES = ("J_red", "tau_red", "dJ_red", "M")  # there are none where others lead


class ChartedResult(SimulationResult[M]):
    """The result of a simulation over several charts.

    Outputs that are of a formation sequence alone, such as an inertia reduced to a driver, are NaN
    where another one leads.
    """

    _settings: dict[str, Any]

    @cached_property
    def _legs(self) -> list[tuple[Leg, NDArray[np.intp]]]:
        """Legs, and which samples are in each."""
        legs, t = self.motion.legs, self.samples.time
        assert t is not None
        begins = [leg.motion.t_start for leg in legs]
        which = np.maximum(np.searchsorted(begins, t, "right") - 1, 0)
        return [(leg, np.flatnonzero(which == i)) for i, leg in enumerate(legs)]

    @cached_property
    def _parts(self) -> list[SimulationResult[Any]]:
        """Results in the mechanisms of the legs, which do not know drivers that do not lead."""
        made = []
        how = {key: x for key, x in self.settings.items() if key != "static"}
        for leg, at in self._legs:
            own = leg.chart.mechanism
            want = [name for name in self.plan.want if name in own.outputs]
            want += [own.of_driver(d, "acceleration") for d in own.drivers]
            t = np.asarray(self.samples.time)[at]
            made.append(
                result_along(own, leg.motion, t, dict.fromkeys(want), engine=self.engine, **how)
            )
        return made

    def _make(self, name: str) -> Any:
        if self.output(name).kind == "number":
            return FREE  # efficiencies, which all are by drives
        whole: Any = None
        for (leg, at), part in zip(self._legs, self._parts, strict=True):
            some = part[name] if name in part else self._of_driver(leg, at, part, name)
            if whole is None:
                whole = np.full((self.n, *np.shape(some)[1:]), np.nan, np.asarray(some).dtype)
            whole[at] = some
        return whole

    def _of_driver(self, leg: Leg, at: Any, part: SimulationResult[Any], name: str) -> Floats:
        """What is of a driver that does not lead a leg."""
        head, _, what = name.rpartition(".")
        drivers = [self._compiled.of_driver(d, "q")[:-2] for d in self._compiled.drivers]
        if head not in drivers or what in OF_COORDINATES:
            return np.full(len(at), np.nan)
        if what in IDLE:
            return np.zeros(len(at))
        i, t = drivers.index(head), np.asarray(self.samples.time)[at]
        state = leg.state(t)
        if what in ("q", "rate"):
            return state[what == "rate"].reshape(len(at), -1)[:, i]
        own = part.mechanism
        qdd = np.array([part[own.of_driver(d, what)] for d in own.drivers]).T
        q, qd = (x.reshape(len(at), -1) for x in leg.motion.at(t))
        rows = (leg.counted.pairs.rows(*both) for both in zip(q, qd, strict=True))
        return np.array([R[i] @ a + drift[i] for (R, drift), a in zip(rows, qdd, strict=True)])

    @cached_property
    def quality(self) -> Quality:
        """Status of each sample and flags, each by the chart that leads there."""
        status, blame, flags = [""] * self.n, dict[int, str](), list[Flag]()
        for (_, at), part in zip(self._legs, self._parts, strict=True):
            own = part.quality
            for i, word in zip(at.tolist(), own.status, strict=True):
                status[i] = word
            blame |= {int(at[i]): block for i, block in own.blame.items()}
            flags += [replace(flag, sample=int(at[flag.sample])) for flag in own.flags]
        return Quality(tuple(status), blame, {}, {}, {}, {}, tuple(flags))

    @property
    def digits_lost(self) -> Any:
        """Those of the legs."""
        each = zip(self._legs, self._parts, strict=True)
        return tuple(
            replace(flag, sample=int(at[flag.sample]))
            for (_, at), part in each
            for flag in part.digits_lost
        )

    def surely_whole(self) -> bool:
        """A cheap sufficient test that every sample has an answer."""
        return all(part.surely_whole() for part in self._parts)

    def _again(self, mechanism: Any, want: Sequence[str], settings: Any = None) -> Any:
        return charted_result(
            mechanism,
            self.motion,
            np.asarray(self.samples.time),
            want,
            self.engine,
            settings or self.settings,
        )


def charted_result(
    mechanism: Compiled, motion: Motion, t: Floats, want: Any, engine: str, settings: Any
) -> ChartedResult[Any]:
    """The wanted outputs at times (n,) [s] of a motion over several charts."""
    how = friction_asked(settings["friction"], settings["tolerance"], settings["iterations"])
    plan = mechanism.planned(want, how)
    q, qd = (x.reshape(len(t), -1).T for x in motion.at(t))
    given = {
        f"{part}_{i}": row for part, rows in (("q", q), ("qd", qd)) for i, row in enumerate(rows)
    }
    return ChartedResult(mechanism, plan, Samples(len(t), given, t), (), engine, settings, motion)
