"""Systems made of plain functions, for tests: no mechanism stands behind them."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

from blockmech.dynamics import methods
from blockmech.dynamics.ends import Budget
from blockmech.dynamics.programs import Sample, ScalarTerms
from blockmech.dynamics.request import SimulationRequest, Start, Until
from blockmech.dynamics.steady import steady_motion
from blockmech.dynamics.system import System
from blockmech.ground.plane import EPS

TURN = 2 * math.pi


class Synthetic(System):
    """A system of functions.

    one : (q, q', t) -> J, tau, dJ, margin; or terms (q, q', t) -> M, c, Q, margin with k drivers
    batch : the same for arrays, J, tau, margin; without it the states are taken one by one
    """

    depends_on = frozenset({"q"})
    period = TURN
    knots = ()
    span = TURN
    lossless = False
    smooth = True
    friction = None
    table = None
    engine_of_states = SimpleNamespace(name="scalar")
    drivers = ("q",)
    rotary = (True,)
    contacts = {}

    def __init__(self, one=None, batch=None, *, terms=None, k=1, **options):
        self._scalar, self._batch_terms, self._full_terms = one, batch, terms
        self.method = self.progress = None
        self.samples = self.calls = self.singles = self.states = 0
        self.steppers, self.budget = {}, Budget()
        names = tuple("q" if k == 1 else f"q{i}" for i in range(k))
        vars(self)["drivers"], vars(self)["rotary"] = names, (True,) * k
        no_turns = SimpleNamespace(rotary=False)
        structure = SimpleNamespace(
            elements={}, driver_joint=lambda driver: no_turns, turns=lambda driver: 1
        )
        self.compiled = SimpleNamespace(
            structure=structure,
            drivers=names,
            frictional_joints=(),
            once=lambda make: make(self.compiled),
        )
        self.stops = ((-math.inf, math.inf),) * k
        for name, value in options.items():
            vars(self)[name] = (value,) if name == "stops" and np.ndim(value) == 1 else value

    def but(self, **options):
        """The same with something else."""
        given = {
            "one": self._scalar,
            "batch": self._batch_terms,
            "terms": self._full_terms,
            "k": len(self.drivers),
        }
        own = ("depends_on", "period", "knots", "span", "stops", "rotary", "lossless")
        kept = {name: getattr(self, name) for name in own}
        if "one" in options and "batch" not in options:
            given["batch"] = None
        return Synthetic(**{**given, **kept, **options})

    @property
    def cache(self):
        return {}

    @property
    def compiled_states(self):
        return False  # it has no program

    def roundings(self, q):
        return 8 * EPS * np.ones(q.shape)

    def scalar_terms(self, q, qd=0.0, t=0.0, *states):
        self._count(1, False)
        return ScalarTerms(*self._scalar(q, qd, t))

    def sample(self, q, qd=0.0, t=0.0):
        self._count(q.size, True)
        rates = np.broadcast_to(np.asarray(qd, dtype=float), q.shape)
        if self._batch_terms is not None:
            with np.errstate(all="ignore"):
                result = self._batch_terms(q, rates, t)
            return Sample(*(np.broadcast_to(x, q.shape).astype(float) for x in result))
        rows = [
            self._scalar(float(a), float(b), t) for a, b in zip(q.flat, rates.flat, strict=True)
        ]
        columns = zip(*rows, strict=True)
        J, tau, _, margin = (np.array(c, dtype=float).reshape(q.shape) for c in columns)
        return Sample(J, tau, margin)

    def terms(self, q, qd, t=0.0, *states):
        if self._full_terms is None:
            return super().terms(q, qd, t)
        self._count(1, False)
        return self._full_terms(q, qd, t)


def move(
    system, start, until, method="auto", accuracy=None, step=None, watch=(), times=(), progress=None
):
    """The motion of a system, as `simulate` asks for it."""
    until = Until.parse(until) if isinstance(until, str) else until
    if not isinstance(start, Start):
        start = Start(*(np.asarray(x, dtype=float) for x in start[:2]))
    system.progress = progress
    system.samples = system.calls = system.singles = 0
    request = SimulationRequest(
        start, until, accuracy, method, step, tuple(np.ravel(times).tolist()), tuple(watch)
    )
    search = steady_motion if until.goal == "steady" else None
    return methods.move(system, request, search)
