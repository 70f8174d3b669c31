"""Modes along a driver: arcs, the dead centres that join them, and what a turn does.

Followed poses are checked by following them again, in many small steps of another
solver, and the places of dead centres by the exact count of modes beside them.
"""

import itertools
import math
from functools import cache

import numpy as np
import pytest

from blockmech.ground.errors import RequestError
from blockmech.modes.circuits import connect
from blockmech.modes.closing import triad_modes
from blockmech.modes.triad import Triad
from tests.modes import chance
from tests.modes.exact import count_exactly

TURN = 2 * math.pi
STEPS = 12  # between neighbouring check points, of the test's own following
FOUND = 1e-6  # [-; of sizes about 1]: a pose that is the one and not another
BESIDE = 1e-9  # [rad] of a dead centre, where two modes are there or gone
PLACE = 1e-12  # [rad]


class Cranked:
    """A triad whose first pivot is on a crank."""

    def __init__(self, pins, at, pivots, crank, lengths):
        self.pins, self.at, self.pivots = pins, at, pivots
        self.crank, self.lengths = crank, lengths
        self.triad = Triad.rrr(lengths, pins)

    def outer(self, q):
        return self.at + self.crank * np.exp(1j * q), *self.pivots

    def exact(self, q):
        return count_exactly(self.outer(q), self.lengths, self.pins)

    def connected(self, **options):
        return connect(self.triad, self.outer, **options)


@cache
def by_chance(seed):
    """A random triad on a crank, and its arcs."""
    rng = np.random.default_rng(seed)
    pivots, lengths, pins, _ = chance.triad(rng)
    crank = abs(rng.normal())
    at = pivots[0] - crank * np.exp(1j * rng.uniform(0, TURN))
    machine = Cranked(pins, at, pivots[1:], crank, lengths)
    return machine, machine.connected()


BY_CHANCE = pytest.mark.parametrize("seed", range(4))


def overturned():
    """Two arcs longer than a turn: after a turn they are other modes."""
    return Cranked(
        [0, 0.52 + 0.12j, 0.69 + 0.86j], 0, [0.61 + 0.97j, 0.91 - 1.74j], 1.6, [1.62, 1.12, 2.75]
    )


def newton(machine, q, o, e):
    """The pose near (o, e): three distances, squared, by plain Newton steps."""
    for _ in range(6):
        u = [o + e * p - g for p, g in zip(machine.pins, machine.outer(q), strict=True)]
        f = [abs(x) ** 2 - l * l for x, l in zip(u, machine.lengths, strict=True)]
        rows = [
            [2 * x.real, 2 * x.imag, 2 * (x.conjugate() * 1j * e * p).real]
            for x, p in zip(u, machine.pins, strict=True)
        ]
        x, y, turn = np.linalg.solve(rows, f)
        o, e = o - complex(x, y), e * np.exp(-1j * turn)
    return o, e


# ---- arcs --------------------------------------------------------------------------------


@BY_CHANCE
def test_an_arc_is_one_mode_followed_along_the_driver(seed):
    machine, circuits = by_chance(seed)
    compared = 0
    for passes in circuits.passes:
        for (j, k), (i, n) in itertools.pairwise(passes):
            begin, end = circuits.nodes[j], circuits.nodes[i]
            end += TURN * (end < begin)
            first, second = circuits.modes[j][k], circuits.modes[i][n]
            if min(first.margin, second.margin) < 1e-4:
                continue  # too close to a dead centre for steps by the driver
            o, e = first.o, first.e
            for q in np.linspace(begin, end, STEPS + 1)[1:]:
                o, e = newton(machine, q, o, e)
            assert abs(o - second.o) + abs(e - second.e) <= FOUND
            compared += 1
    assert compared > 20


@BY_CHANCE
def test_two_modes_appear_or_vanish_at_each_dead_centre(seed):
    machine, circuits = by_chance(seed)
    for n, arc in enumerate(circuits.arcs):
        for end, inward in ((arc.start, 1), (arc.end, -1)):
            if end.how != "dead centre":
                continue
            inside, outside = (machine.exact(end.q + side * inward * BESIDE) for side in (1, -1))
            assert inside == outside + 2
            assert any(m.double for m in triad_modes(machine.triad, machine.outer(end.q)))
            partner = circuits.arcs[end.other]
            assert partner.circuit == arc.circuit
            assert partner.sign == -arc.sign != 0
            same = (partner.start, partner.end)
            assert any(
                abs(math.remainder(x.q - end.q, TURN)) <= PLACE and x.other == n for x in same
            )


@BY_CHANCE
def test_every_mode_at_every_check_point_is_on_one_arc(seed):
    _, circuits = by_chance(seed)
    passed = sorted(at for passes in circuits.passes for at in passes)
    every = [(j, k) for j, modes in enumerate(circuits.modes) for k in range(len(modes))]
    assert passed == every
    for j, k in every:
        assert circuits.arcs[circuits.arc_of((j, k))].sign == circuits.modes[j][k].sign


@BY_CHANCE
def test_between_dead_centres_the_number_of_arcs_is_the_exact_number_of_modes(seed):
    machine, circuits = by_chance(seed)
    for q in np.random.default_rng(seed).uniform(0, TURN, size=6):
        count = 0
        for arc in circuits.arcs:
            first = math.ceil((arc.start.q - q) / TURN)
            last = math.floor((arc.end.q - q) / TURN)
            count += arc.turns or last - first + 1
        assert count == machine.exact(q)


# ---- a turn ------------------------------------------------------------------------------


def test_after_a_turn_a_mode_may_be_another_one():
    machine = overturned()
    result = machine.connected()
    long = [arc for arc in result.arcs if arc.end.q - arc.start.q > TURN]
    assert len(long) == 2
    check = next(
        j for j, q in enumerate(result.nodes) if long[0].start.q + 0.1 < q < long[0].end.q - TURN
    )
    then = [result.after_turn((check, k)) for k in range(len(result.modes[check]))]
    assert sum(x is not None for x in then) == 2
    for mode, other in enumerate(then):
        if other is None:
            continue
        o, e = result.modes[check][mode].o, result.modes[check][mode].e
        begin = result.nodes[check]
        for q in np.linspace(begin, begin + TURN, 500)[1:]:
            o, e = newton(machine, q, o, e)
        assert abs(o - result.modes[check][other].o) <= FOUND
        assert other != mode


def test_a_small_crank_brings_every_mode_back_to_itself():
    pins, pivots, lengths = [0, 4, 3 + 4j], [0, 5, 1 + 4j], [4.0, 4.0, 4.0]
    machine = Cranked(pins, -0.01, pivots[1:], 0.01, lengths)
    result = machine.connected()
    assert [result.after_turn((0, k)) for k in range(6)] == [0, 1, 2, 3, 4, 5]
    assert [arc.circuit for arc in result.arcs] == [0, 1, 2, 3, 4, 5]
    assert all((arc.start.how, arc.turns) == ("turn", 1) for arc in result.arcs)
    assert all((arc.start.q, arc.end.q) == (0, pytest.approx(TURN)) for arc in result.arcs)


def test_change_points_of_a_parallelogram_are_passed_straight():
    # Pins 1 and 2 are one: crank 1, coupler 3 and leg 2 of length 1 on a frame of 3 are a
    # parallelogram, on one line at 0 and pi; leg 3 hangs from its pin.
    triad = Triad.rrr([3, 1, 4], [0, 0, 1])
    connections = connect(triad, lambda q: (np.exp(1j * q), 3, 1.5 + 3.5j))
    for arc in connections.arcs:
        assert arc.sign == 0
        passed = sorted(abs(math.remainder(q, TURN)) for q in arc.change_points)
        assert passed == pytest.approx([0, math.pi], abs=1e-11)
    # Parallel all along: leg 2 keeps the crank's direction on two of the arcs.
    pins = [
        {
            abs(connections.modes[j][k].o - 3 - np.exp(1j * connections.nodes[j])) < FOUND
            for j, k in passes
        }
        for passes in connections.passes
    ]
    assert sorted(pins, key=str) == [{False}, {False}, {True}, {True}]


def test_galloway_s_long_links_turn_once_in_two_turns_of_the_short_one():
    # Frame and crank 1, coupler and leg 2 of length 3 about one pin: a kite. Leg 3 reaches
    # the platform's other pin everywhere. After one turn of the crank the kite is inverted.
    triad = Triad.rrr([3, 3, 3], [0, 0, 2])
    connections = connect(triad, lambda q: (np.exp(1j * q), 1, 1 + 1j))
    assert [arc.turns for arc in connections.arcs] == [2, 2]
    for check, (q, modes) in enumerate(zip(connections.nodes, connections.modes, strict=True)):
        then = [connections.after_turn((check, k)) for k in range(len(modes))]
        for mode, other in enumerate(then):
            assert then[other] == mode
            # the pin lies on the kite's axis, on the other side of the crank's end and pivot
            axis = 1 + np.exp(1j * q)
            one, two = ((modes[n].o / axis).real * abs(axis) for n in (mode, other))
            assert one + two == pytest.approx(abs(axis), abs=FOUND)
            assert other != mode


def test_a_range_has_arcs_that_end_with_it():
    machine = overturned()
    result = machine.connected(low=3.5, high=4.5, ends="range")
    assert {end.how for arc in result.arcs for end in (arc.start, arc.end)} == {"range"}
    assert all((arc.start.q, arc.end.q) == (3.5, 4.5) for arc in result.arcs)
    assert len(result.arcs) == machine.exact(4.0) == 2


def test_an_empty_range_is_refused():
    with pytest.raises(RequestError, match="a range of the driver is needed"):
        overturned().connected(low=1.0, high=1.0)
