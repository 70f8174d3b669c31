"""End stops: of drivers, and of the coordinates of other pairs, a slider's way or a pin's angle.

The only driver of a mechanism moves each pair along one path, so a stop of any pair is a stop of
the driver: at the place x where the pair's coordinate phi gets to its bound. A blow there with
restitution e turns phi' = phi_x x' to -e phi', and with it x' to -e x'; the impulse along the
pair's coordinate is the driver's over phi_x. Several drivers get there at a place that nobody
knows before: their stops of pairs are watched along the motion (`pair_stops`).

Source: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, ch. 8.
"""

from __future__ import annotations

import math
from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from blockmech.dynamics.change_points import system_of
from blockmech.dynamics.loads import REACH, largest_length
from blockmech.dynamics.pair_stops import Counted, stopped_pairs
from blockmech.dynamics.request import STOPS, Pairs, SimulationRequest, pairs_of
from blockmech.dynamics.system import System
from blockmech.functions.roots import SCANNED
from blockmech.ground.errors import Problem, RequestError, refused, unknown_name
from blockmech.ground.plane import EPS
from blockmech.model.structure import COORDINATE
from blockmech.typing import Arguments, Real

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

TURNS = 64  # beyond which the stop of a pin that turns on is not looked for
LEAST_SLOPE = math.sqrt(EPS)  # of a pair's coordinate by the driver's, where it strikes a stop


class Stop(NamedTuple):
    """An end stop as the only driver gets to it, or where it is of one of several or of a pair.

    name : of the driver, or of the pair's coordinate, whose stop it is
    q : coordinate there [rad or m], of the only driver; infinite where there is none
    restitution : [-], None where a motion ends there
    slope : of the coordinate whose stop it is by the driver's
    """

    name: str
    q: float
    restitution: float | None = None
    slope: float = 1.0


Between = tuple[Stop, Stop]
BY_PLACE = attrgetter("q")


def stops_of(mechanism: Compiled, starts: Pairs, stops: Any) -> tuple[Between, ...]:
    """The lowest and the highest stop of each driver: those given, else the scene's.

    With several drivers then those of pairs.

    Raises `RequestError` for names of nothing, stops in the wrong order, or a start that is
    not between them.
    """
    call_stops = pairs_of("stops", stops, STOPS, mechanism._coordinate_units)
    scene = mechanism.scene
    bounds = {d: s.bounds for d, s in scene.stops.items()} if call_stops is None else call_stops
    problems: list[Problem] = []
    stops_by_name: dict[str, Between] = {}
    driver, several = next(iter(starts)), len(starts) > 1
    for name in dict.fromkeys((*starts, *bounds)):
        low, high = map(float, bounds.get(name, (-math.inf, math.inf)))
        where = scene.address("stops", name) if call_stops is None else f"stops.{name}"
        e = scene.stops[name].restitution if name in scene.stops else None
        between = Stop(name, low, e), Stop(name, high, e)
        if name in starts or several:
            stops_by_name[name] = between
        if name not in starts and not _is_coordinate(mechanism, name):
            names = [*starts, *filter(_ends_so, mechanism.outputs)]
            problems.append(unknown_name("unknown-driver", "driver", name, where, names))
        elif not low < high:
            order = f"the lowest must be below the highest, got {low:.9g} and {high:.9g}"
            problems.append(Problem("bad-value", where, order))
        elif name in starts and not low <= (q := starts[name][0]) <= high:
            problems.append(_outside(where, f"{name}.q", q, low, high))
        elif name not in stops_by_name:
            try:
                of_driver = _of_pair(mechanism, name, between, starts, where)
                lows, highs = zip(stops_by_name[driver], of_driver, strict=True)
                stops_by_name[driver] = max(lows, key=BY_PLACE), min(highs, key=BY_PLACE)
            except RequestError as error:
                problems += error.problems
    RequestError.raise_for(problems)
    return tuple(stops_by_name.values())


def _outside(where: str, name: str, value: float, low: float, high: float) -> Problem:
    outside = f"the start {name} = {value:.9g} is not between the end stops"
    valid, remedy = f"{low:.9g} to {high:.9g}", "start between them, or move them"
    return Problem("start-outside-stops", where, outside, valid, remedy)


def _ends_so(name: str) -> bool:
    return name.endswith(f".{COORDINATE}")


def _is_coordinate(mechanism: Compiled, name: str) -> bool:
    return _ends_so(name) and name in mechanism.outputs


def _turns(coordinate: float, low: float, high: float, rotary: bool) -> float:
    """Whole turns [rad] that a place is counted with: stops say how many, where it is an angle."""
    nearest = min(max(coordinate, low), high)
    return math.tau * round((nearest - coordinate) / math.tau) if rotary else 0.0


def counted_pairs(mechanism: Compiled, starts: Pairs, stops: tuple[Between, ...]) -> Counted | None:
    """Coordinates of pairs that have stops along a motion of several drivers; None without any.

    Raises `RequestError` for a start that is not between them.
    """
    pairs = stopped_pairs(mechanism, [low.name for low, _ in stops[len(starts) :]])
    if not pairs.names:
        return None
    q = np.array([q for q, _ in starts.values()])
    at_start = []
    for (low, high), x, rotary in zip(
        stops[len(starts) :], pairs.state(q, 0 * q)[0], pairs.rotary, strict=True
    ):
        coordinate = float(x + _turns(x, low.q, high.q, rotary))
        if not low.q <= coordinate <= high.q:  # nor does a start that does not close
            where = mechanism.scene.address("stops", low.name)
            raise RequestError(_outside(where, low.name, coordinate, low.q, high.q))
        at_start.append(coordinate)
    return Counted(pairs, q, np.array(at_start))


def _of_pair(
    mechanism: Compiled, name: str, between: Between, starts: Pairs, where: str
) -> Between:
    """The places of the only driver, below and above its start, at which a pair gets to a bound."""
    ((driver, (q0, _)),) = starts.items()
    phi, (low, high) = _Coordinate(mechanism, driver, name, q0), (stop.q for stop in between)
    phi.shift = _turns(phi.start, low, high, phi.rotary)
    if not low <= phi.start + phi.shift <= high:
        raise RequestError(_outside(where, name, phi.start + phi.shift, low, high))
    limits = [phi.reaches(low, high, direction) for direction in (-1, 1)]
    first, last = (between[0]._replace(q=q, slope=phi.slope(q)) for q in limits)
    return first, last


class _Coordinate:
    """Coordinate of a pair along the only driver, continued from where that starts."""

    shift = 0.0  # [rad] whole turns that it is counted from

    def __init__(self, mechanism: Compiled, driver: str, name: str, q0: float) -> None:
        self.mechanism, self.driver, self.name, self.q0 = mechanism, driver, name, q0
        self.rotary = mechanism.outputs[name].unit == "rad"
        self.turns = mechanism.structure.driver_joint(driver).rotary
        self.start = float(self.values_at(np.array([q0]))[0])

    def values_at(self, q: Real) -> Real:
        """Values (n,) at places (n,) in a row; NaN where the mechanism does not close."""
        run = self.mechanism.run(at={self.driver: q}, want=[self.name], on_gap="mark")
        values = np.asarray(run[self.name], dtype=float)
        if self.rotary:
            good = np.isfinite(values)
            values[good] = np.unwrap(values[good])
        return values + self.shift

    def reaches(self, low: float, high: float, direction: int) -> float:
        """The first place in a direction at which it gets to a bound; infinite for none."""
        from scipy.optimize import brentq

        size = math.tau if self.turns else REACH * largest_length(self.mechanism.structure)
        q, before = self.q0, self.start + self.shift
        for _ in range(TURNS if self.turns else 1):
            coordinates = q + direction * np.linspace(0.0, size, SCANNED + 1)
            values = self.values_at(coordinates)
            if self.rotary:
                values += math.tau * np.round((before - values[0]) / math.tau)
            out = np.flatnonzero(~((values >= low) & (values <= high)))
            out = out[out > 0]
            if out.size:
                i = int(out[0])
                if math.isnan(values[i]):  # a dead centre comes before
                    return direction * math.inf
                bound = high if values[i] > high else low
                offset = values[i - 1] - bound

                def beyond(x: float, offset: float = offset, bound: float = bound) -> float:
                    value = float(self.values_at(np.array([x]))[0]) - bound
                    return value + (
                        math.tau * round((offset - value) / math.tau) if self.rotary else 0
                    )

                ends = sorted((coordinates[i - 1], coordinates[i]))
                return float(brentq(beyond, *ends, xtol=1e-15, rtol=1e-15 * 4))
            if not self.rotary or abs(values[-1] - before) < math.pi:  # it comes back every turn
                break
            q, before = float(coordinates[-1]), float(values[-1])
        return direction * math.inf

    def slope(self, q: float) -> float:
        """Its derivative by the driver's coordinate, at a place if there is one."""
        if math.isinf(q):
            return 1.0
        pair = stopped_pairs(self.mechanism, [self.name])
        slope = float(pair.state(np.array([q]), np.zeros(1))[1][0, 0])
        if abs(slope) < LEAST_SLOPE:
            fault = f"{self.name} turns back where it touches its stop"
            fault += f", at {self.driver}.q = {q:.9g}"
            raise refused(f"stops.{self.name}", fault, "move the stop", code="stops")
        return slope


def prepared(
    mechanism: Compiled,
    request: SimulationRequest,
    starts: Pairs,
    stops: Pairs | None,
    options: Arguments,
) -> tuple[System, SimulationRequest]:
    """The system of a mechanism that begins somewhere, and the request with its end stops.

    Raises `RequestError` for stops that cannot be.
    """
    between = stops_of(mechanism, starts, stops)
    if any(stop.restitution is not None for both in between for stop in both):
        request = replace(request, stops=between)
    counted = counted_pairs(mechanism, starts, between)
    bounds = tuple((low.q, high.q) for low, high in between)
    about = {"stops": bounds, "counted": counted, "roles": request.roles}
    return system_of(mechanism, **about, **options), request
