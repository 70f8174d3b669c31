"""Functions of plain Python say the same as machine code, to the last bit."""

import ctypes
import itertools
import math
from collections.abc import Callable
from functools import partial
from typing import Annotated, NamedTuple

import numpy as np
import pytest
from scipy.integrate import DOP853

from blockmech.dynamics.equation import cached_rates
from blockmech.dynamics.system import System
from blockmech.engines import dense, loops, radau, stages
from blockmech.engines.assembly import Lanes, Text, piece, spread
from blockmech.engines.kinds import Counts, Reals, arrays_of
from blockmech.engines.nodes import SAMPLE
from blockmech.engines.trace import Trace, solve
from tests.gallery import mechanism

pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")

from blockmech.engines.llvm import FILL, addresses_of, machine_code

THIRD = 1 / 3


class Sizes(NamedTuple):
    """Of a matrix."""

    rows: int
    columns: int


def compiled(**functions):
    """Functions as machine code, which take arrays as they are."""
    kinds = [(name, loops.signature(f)) for name, f in functions.items()]
    programs = machine_code(loops.text(**functions), *kinds)

    def calling(function):
        def call(*arguments):
            return function(*(x.ctypes.data if isinstance(x, np.ndarray) else x for x in arguments))

        return call

    return [calling(f) for f in programs]


def simpson(f: Callable[[float, int], float], a: float, b: float, n: int) -> float:
    """Simpson's rule over n pairs."""
    h, total = (b - a) / (2 * n), 0.0
    for k in range(2 * n + 1):
        weight = 1.0 if k == 0 or k == 2 * n else (4.0 if k - (k >> 1) * 2 == 1 else 2.0)
        total += weight * f(a + k * h, k)
    return h * THIRD * total


def wave(x: float, k: int) -> float:
    """A number of both."""
    if k > 3 and not math.sin(x) < 0.3:
        return math.exp(-x) * math.copysign(k, math.cos(7 * x))
    return min(x, 0.5 * k) - max(math.sqrt(x), abs(-x))


def simpson_of_wave(a: float, b: float, n: int) -> float:
    """A function that is asked by name."""
    return simpson(wave, a, b, n)


def sieve(primes: Counts, n: int) -> int:
    """How many primes below n, and which."""
    count = 0
    for k in range(2, n):
        prime = True
        for j in range(count):
            if primes[j] * primes[j] > k:
                break
            remainder = k
            while remainder > 0:
                remainder -= primes[j]
            if remainder < 0:
                continue
            prime = False
        if prime:
            primes[count] = k
            count += 1
    return count


def reflected(of: Sizes, a: Annotated[Reals, "of.columns"], turns: int) -> None:
    """Rows upside down, some times, and each number by its place."""
    for _ in range(turns):
        for i in range(of.rows - 1, of.rows >> 1, -1):
            row, mirror = a[i], a[of.rows - 1 - i]
            for j in range(of.columns):
                row[j], mirror[j] = mirror[j], row[j]
        weighted(of, a[1:], 0.1)


def weighted(of: Sizes, a: Annotated[Reals, "of.columns"], by: float) -> None:
    """All but one row."""
    for i in range(of.rows - 1):
        for j in range(of.columns):
            a[i, j] *= by * i - j
            if a[i, j] == 0.0 or (j != 1 and a[i, 0] <= -1e3):
                return


class Table(NamedTuple):
    """Rows and what each is to be multiplied by."""

    rows: Annotated[Reals, "of.columns"]
    by: Reals
    done: Counts


def scaled(of: Sizes, table: Table) -> int:
    """Rows of a record, by a function that takes it on."""
    for i in range(of.rows):
        scaled_row(of, table, i)
    return table.done[0]


def scaled_row(of: Sizes, table: Table, i: int) -> None:
    """One of them."""
    row = table.rows[i]
    for j in range(of.columns):
        row[j] *= table.by[i]
    table.done[0] += i


def stacked(of: Sizes, rows: Reals, by: Reals, done: Counts, many: int) -> int:
    """Records made of arrays, one after the other."""
    count = 0
    for k in range(many):
        count += scaled(of, Table(rows[k * of.rows * of.columns :], by[k:], done))
    return count


def missing(table: Table) -> float:
    """A record has its own fields only."""
    return table.columns[0]


def so_far(table: Table) -> int:
    """A count of a record."""
    return table.done[0]


def half(a: Reals) -> int:
    """A record has all its arrays."""
    return so_far(Table(a, a, a))


def rebound(table: Table, second: Table) -> float:
    """A record is what it was given as."""
    table = second
    return table.by[0]


@pytest.mark.parametrize("n", [1, 4, 37])
def test_numbers(n):
    (fast,) = compiled(simpson_of_wave=simpson_of_wave)
    assert fast(0.1, 2.3, n) == simpson(wave, 0.1, 2.3, n)


def test_counts():
    (fast,) = compiled(sieve=sieve)
    primes, same = (np.zeros(100, np.int64) for _ in range(2))
    assert fast(primes, 200) == sieve(same, 200) == 46
    np.testing.assert_array_equal(primes, same)


@pytest.mark.parametrize("turns", [0, 1, 5])
def test_rows(turns):
    of = Sizes(5, 3)
    (fast,) = compiled(reflected=partial(reflected, of=of))
    a = np.random.default_rng(turns).normal(size=of)
    copy = a.copy()
    fast(a, turns)
    reflected(of, copy, turns)
    np.testing.assert_array_equal(a, copy)


def test_records_of_arrays():
    of, rng = Sizes(4, 3), np.random.default_rng(1)
    (fast,) = compiled(scaled=partial(scaled, of=of))
    a, by = rng.normal(size=of), rng.normal(size=4)
    first, second = (Table(a.copy(), by, np.zeros(1, np.int64)) for _ in range(2))
    assert fast(loops.addresses_of(first)) == scaled(of, second) == 6
    np.testing.assert_array_equal(first.rows, second.rows)
    (fast,) = compiled(stacked=partial(stacked, of=of))
    rows, factors, done = rng.normal(size=(3, *of)), rng.normal(size=6), np.zeros(1, np.int64)
    same = rows.copy()
    assert fast(rows, factors, done, 3) == 6 + 12 + 18
    for k in range(3):
        same[k] *= factors[k : k + 4, None]
    np.testing.assert_array_equal(rows, same)


@pytest.mark.parametrize("n", [2, 5, 64])
def test_pieces_of_tables(n):
    (fast,) = compiled(piece=piece)
    knots = np.sort(np.random.default_rng(n).normal(size=n))
    for x in (*knots, *(knots + 0.01), -9.0, 9.0, math.nan):
        assert fast(knots, n, x) == piece(knots, n, x)


def test_the_scheme_is_that_of_scipy():
    by, n = stages.scheme(), DOP853.n_stages
    ours = by.A[:n, :n], by.A[n, :n], by.A[n + 1 :], by.C[:n], by.C[n + 1 :], *by.E, by.D[::-1]
    theirs = DOP853.A, DOP853.B, DOP853.A_EXTRA, DOP853.C, DOP853.C_EXTRA, DOP853.E5, DOP853.E3
    for computed, reference in zip(ours, (*theirs, DOP853.D), strict=True):
        np.testing.assert_array_equal(computed, reference)
    assert by.C[n] == 1.0


def test_a_finer_run_takes_half_the_steps_of_a_coarser_one():
    plan = np.array([0.0, 1.0, 1.5, 3.0])
    (fast,) = compiled(halved=stages.halved)
    for t, h, half in (
        (0.0, 9.0, 0.5),
        (0.5, 9.0, 0.5),
        (0.8, 9.0, 0.25),  # up to half of the next one, which is shorter
        (1.25, 9.0, 0.25),
        (1.25, 0.1, 0.1),  # its own are shorter
        (1.5, 9.0, 0.75),
        (3.0, 9.0, 9.0),  # beyond its end
    ):
        assert fast(plan, 3, t, h) == stages.halved(plan, 3, t, h) == half
    assert fast(plan, 0, 0.2, 9.0) == 9.0
    events = np.array([1.0, 1.0 + 2e-16, 2.0])  # at which steps would be shorter than rounding
    assert fast(events, 2, 1.0, 9.0) == stages.halved(events, 2, 1.0, 9.0) == 20 * stages.EPS


@pytest.mark.parametrize("name", ["watt_sixbar", "andrews_squeezer", "pump"])
@pytest.mark.parametrize(("lanes", "weight"), [(1, stages.THIRD), (2, stages.THIRD), (2, 0.0)])
def test_steps_are_those_of_python(name, lanes, weight):
    """The loop of the integrator, with the rates by machine code in both."""
    rates = cached_rates(System(mechanism(name), engine="llvm"))
    n, by, width, capacity = rates.dimension, stages.scheme(), len(rates.rows), 12
    sizes = stages.Sizes(n, width, width - rates.watched, by.C.size, by.E.shape[1], lanes)
    fill, over = rates._code(lanes, stages.steps)
    state = np.zeros((rates.inputs, lanes))
    state[n + 2], state[n + 3] = 1.0, 1e-9
    x = addresses_of(state[:, 0])

    def same(_x, numbers, out, *_):
        fill(x, numbers.ctypes.data, out.ctypes.data, lanes, lanes, 0, 1)

    def integrate(call):
        y, t = np.zeros((lanes, 13, n)), np.zeros(lanes * 13)
        y[:, 0, :2] = 0.7, 2.0
        tolerances = np.full((2, n, lanes), 1e-8)
        tolerances[..., -1] = 1e-10
        control = np.tile([0.0, 0.05, 0.0, -9.0, 9.0, weight], (lanes, 1))
        rhs = np.frombuffer(x), rates.numbers, np.zeros((*by.C.shape, width, lanes)), state
        run = stages.Integration(
            *(y.reshape(-1, n), t, tolerances, control, np.zeros((lanes * capacity, 8, n))),
            *(np.zeros(lanes * capacity, np.int64), np.ones(lanes, np.int64)),
            *(np.linspace(0.0, 0.1, capacity + 2), np.array([capacity + 1])),
        )
        work = stages.Workspace(*arrays(stages.Workspace, sizes))
        call(stages.Rhs(*rhs), by, run, work, capacity)
        return run

    fast = integrate(by_places(over, rates))
    slow = integrate(in_python(stages.steps, sizes, same, rates))
    assert all(np.abs(fast.counts) > 3)
    for compiled_array, expected in zip(fast, slow, strict=True):
        np.testing.assert_array_equal(compiled_array, expected)


def arrays(workspace, of):
    """Those beside the steps of a method."""
    return [np.zeros(shape, kind) for _, kind, shape in arrays_of(workspace, {"of": of})]


def by_places(over, rates):
    """Machine code of steps that takes records."""
    return lambda *arguments: over(
        *map(loops.addresses_of, arguments[:4]), arguments[4], rates.watched
    )


def in_python(steps, of, fill, rates):
    """The same in Python, with rates by machine code."""
    return lambda *arguments: steps(of, fill, *arguments, rates.watched)


@pytest.mark.parametrize("name", ["watt_sixbar", "control/speed_controlled_fourbar"])
def test_stiff_steps_are_those_of_python(name):
    """The same of Radau's method: with matrices, iterations and steps that are tried again."""
    rates = cached_rates(System(mechanism(name), engine="llvm"), radau.radau)
    n, by, capacity = rates.dimension, rates.method, 12
    of, state = rates.sizes(1), np.zeros((rates.inputs, 1))
    x = addresses_of(state[:, 0])

    def same(_x, numbers, out, *_):
        rates.fill(x, numbers.ctypes.data, out.ctypes.data, 1, 1, 0, 1)

    def integrate(call):
        y, t = np.zeros((capacity + 1, n)), np.zeros(capacity + 1)
        y[0, :2], state[n + 2 :, 0] = (0.7, 2.0), (1.0, 1e-9)
        rhs = np.frombuffer(x), rates.numbers, np.zeros((by.stages, of.width, 1)), state
        run = stages.Integration(
            *(y, t, np.full((2, n, 1), 1e-6), np.array([[0.1, 9.0, 0.0, -9.0, 9.0, 0.0]])),
            *(np.zeros((capacity, 8, n)), np.zeros(capacity, np.int64), np.zeros(1, np.int64)),
            *(np.linspace(0.0, 0.3, capacity + 2), np.array([capacity + 1])),
        )
        work = radau.Workspace(*arrays(radau.Workspace, of))
        call(stages.Rhs(*rhs), by.scheme, run, work, capacity)
        return run

    fast = integrate(by_places(rates.steps, rates))
    slow = integrate(in_python(radau.steps, of, same, rates))
    assert abs(fast.counts[0]) > 5
    for compiled_array, expected in zip(fast, slow, strict=True):
        np.testing.assert_array_equal(compiled_array, expected)


def power(x: float) -> float:
    """No operation of the language."""
    return x**2


def mixed(n: int) -> int:
    """A count that becomes a real number."""
    n = 0.5
    n += 1
    return n


def listing(n: int) -> int:
    """No value of the language."""
    a = [n]
    return a[0]


def unknown(x: float) -> float:
    """No function of the language."""
    return math.gamma(x)


def endless(n: int) -> int:
    """No answer where nothing is positive."""
    while True:
        if n > 3:
            return n


def texts(x: str) -> float:
    """No kind of number."""
    return float(x)


@pytest.mark.parametrize(
    ("function", "line", "says"),
    [
        (power, 2, "no operation of this language: Pow of a float"),
        (mixed, 2, "a float where an int is to be"),
        (listing, 2, r"no expression of this language: \[n\]"),
        (unknown, 2, "no function of this language: math.gamma"),
        (missing, 2, "table has no columns"),
        (rebound, 2, "table is no number and no array"),
        (half, 2, "Table is made of its arrays"),
        (endless, 4, "a function with an answer ends with a return"),
    ],
)
def test_what_is_no_part_of_the_language_is_refused_by_its_line(function, line, says):
    at = function.__code__.co_firstlineno + line
    with pytest.raises(TypeError, match=rf"test_loops.py, line {at}: {says}"):
        loops.text(function=function)


def test_arguments_have_kinds_of_the_language():
    with pytest.raises(TypeError, match="<class 'str'> is no kind of argument"):
        loops.text(texts=texts)


@pytest.mark.parametrize("n", [3, 6, 12])
def test_extreme_singular_values_are_those_of_python_and_near_those_of_lapack(n):
    """Of eight matrices side by side: dense, sparse, nearly singular, singular, orthogonal, NaN."""
    rng = np.random.default_rng(n)
    a = rng.normal(size=(8, n, n))
    a[1] *= rng.random((n, n)) < 0.4
    a[2, :, -1] = a[2, :, 0] * (1 + 1e-9 * rng.normal(size=n))
    a[3, 1] = a[3, 0]
    a[4] = np.linalg.qr(a[4])[0]
    a[5] = np.diag(10.0 ** -np.arange(n))
    a[6, n - 1, 0] = math.nan
    of = Lanes(8, n)
    (fast,) = compiled(spread=partial(spread, of=of))
    first, second = (np.ascontiguousarray(a.transpose(2, 1, 0).reshape(n * n, 8)) for _ in range(2))
    fast(first)
    with np.errstate(all="ignore"):
        spread(of, second)
    np.testing.assert_array_equal(first[0], second[0])
    good = np.arange(8) != 6
    values = np.linalg.svd(a[good], compute_uv=False)
    np.testing.assert_allclose(first[0, good], values[:, -1] / values[:, 0], rtol=0, atol=4e-16)
    assert math.isnan(first[0, 6])


@pytest.mark.parametrize("unit", [0.0, 1.0])
def test_systems_are_solved_flat_with_pivots_of_each_lane(unit):
    """Also where the first entry is zero in some lanes; a singular one has no finite solution."""
    n, rng = 5, np.random.default_rng(3)
    a, right = rng.normal(size=(n, n, 16)), rng.normal(size=(n, 16))
    a[0, 0, :4], a[3], a[1, 2] = 0.0, 0.0, 0.0
    a[3, 4], a[3, 1] = unit, rng.normal(size=16)
    a[2, :, 15] = a[0, :, 15]
    trace = Trace.__new__(Trace)
    trace.nodes, trace._made = [], {}
    numbers = itertools.count()

    def fresh(x):
        return trace._leaf("input", next(numbers), SAMPLE) if np.any(x) else 0.0

    rows = [[1.0 if np.all(x == 1.0) else fresh(x) for x in row] for row in a]
    side = [fresh(x) for x in right]
    values = solve(rows, side)
    entries = [x for row in a for x in row if np.any(x) and not np.all(x == 1.0)] + [*right]
    out = np.empty((n, 16))
    (fill,) = machine_code(Text().fill(len(entries), values), ("fill", FILL))
    pointers = (ctypes.c_void_p * (len(entries) + 1))(
        *(np.ascontiguousarray(x).ctypes.data for x in entries)
    )
    fill(pointers, None, out.ctypes.data, 16, 16, 0, 1)
    want = np.linalg.solve(a[..., :15].transpose(2, 0, 1), right[:, :15].T[..., None])[..., 0]
    np.testing.assert_allclose(out[:, :15].T, want, rtol=1e-12)
    assert not np.isfinite(out[:, 15]).all()


def test_dense_output_is_that_of_python_and_passes_levels_where_it_does():
    rng = np.random.default_rng(5)
    m, n = 5, 3
    steps = rng.uniform(0.1, 1.0, m)
    record = dense.Dense(np.cumsum(steps) - steps, steps, rng.normal(size=(m, 8, n)))
    times = np.linspace(0.0, steps.sum(), 40)
    same = np.empty((n, 40))
    dense.states(record.t, record.h, record.series.ravel(), times, same.ravel(), m, n, 40)
    np.testing.assert_array_equal(record(times), same)
    np.testing.assert_array_equal(record(float(times[7])), same[:, 7])
    for i, sense in itertools.product(range(n), (-1, 0, 1)):
        first = record.part(2, 3)
        level = 0.6 * first(first.t[0])[i] + 0.4 * first(first.t[0] + first.h[0])[i]
        ends = [float(first(t)[i]) - level for t in (first.t[0], first.t[0] + first.h[0])]
        coefficients, found = first.series.ravel()[i:], np.empty(8)
        many = dense.crossings(coefficients, found, n, level, *ends, sense, 8)
        passed = first.crossings(i, level, ends, sense, 8)
        assert passed == [float(first.t[0]) + x * float(first.h[0]) for x in found[:many]]
        assert passed or sense * (ends[1] - ends[0]) < 0
        for t in passed:
            assert abs(first(t)[i] - level) < 1e-12


def rows(of: Sizes, x: Annotated[Reals, "of.columns"], M: Annotated[Reals, "of.columns"]) -> float:
    """Products of a row and of a vector with the rows of a matrix, into the first row."""
    span = np.max(abs(x[0])) - np.min(x[0])
    x[0] = (2.0 * x[1]) @ M + x[0] @ M
    return float(span)


@pytest.mark.parametrize("columns", [1, 16, 50])
def test_a_row_times_the_rows_of_an_array(columns):
    of, rng = Sizes(2, columns), np.random.default_rng(3)
    x, M = rng.normal(size=(2, columns)), rng.normal(size=(columns, columns))
    (by_code,) = compiled(rows=partial(rows, of=of))
    answers = [(y := x.copy(), f(y, M)) for f in (partial(rows, of), by_code)]
    assert answers[0][1] == answers[1][1] == np.abs(x[0]).max() - x[0].min()
    np.testing.assert_allclose(answers[1][0], answers[0][0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(answers[1][0][0], (2 * x[1] + x[0]) @ M, rtol=0, atol=1e-13)
