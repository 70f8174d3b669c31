"""Every solution of a group's friction equations, and the proof that there is no other one.

With loads z_j = g_j on the pairs as unknowns, friction t_j = k_j z_j, and contacts chosen for the
guides, the equations of `blockmech.friction.equations` are polynomials:

    z_j^2 = |f_j + sum_m A_jm z_m|^2   (pin),      z_j = u_j . (f_j + sum_m A_jm z_m)   (guide),

A_jm = R_jm k_m, u_j the direction in which guide j is pressed: +-N, with a length also
+-2 C / L. Of p pins these are p quadrics: 2^p complex solutions by Bezout's theorem, of which
those count that are real, with z_j > 0 and the guides pressed as chosen. (Baranov's degree 16 of
the RRR group counts as many again that square roots of two signs bring in.)

They are followed from zero friction, where they are z_j = +-|f_j|, to the friction stated: not
along the real factors, on which solutions meet in folds, but along a bow through complex ones
that meets none. What is reached is proved, not believed: Newton-Kantorovich's theorem, with a
bound of the rounding errors, encloses each in a ball that holds exactly one solution. Where 2^p
balls lie apart, these are all; a path that has jumped to another's end leaves fewer. Where
rounding is what hides it (loads of one group that differ by many digits) the misfits are
evaluated exactly, in rational numbers.

Sources: Sommese & Wampler, The Numerical Solution of Systems of Polynomials, World Scientific
2005 (parameter homotopy); Rump, Verification methods, Acta Numerica 19 (2010).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import BLUR
from blockmech.typing import Array, Floats, Real, Vectors

CONTACTS = {0: (0j,), 2: (1 + 0j, -1 + 0j), 4: (1 + 0j, -1 + 0j, 1j, -1j)}
"""Contacts of a pair, 0 of a pin -> the directions in which it may be pressed."""

TRACKS = 16384  # followed side by side; they stay in cache, and a triad with nine pins has 512
ATTEMPTS = 3  # bows that are tried until all ends are apart, each with smaller steps
FIRST, LEAST, STEPS = 0.1, 1e-7, 400  # along the bow: first and smallest step, their number
GOOD, EASY = 1e-3, 1e-5  # relative first correction of a step that is taken, that may be doubled
SEED = 20100610  # of the bows: the same systems have the same answer to the last bit


class Equations(NamedTuple):
    """Systems (n,) of one make, scaled: f and A of m pairs, and contacts u (0 of a pin)."""

    f: Vectors  # (n, m) relative to the largest load
    A: Vectors  # (n, m, m)
    u: Vectors  # (n, m)
    bow: Vectors  # (m,) what the squares at the start have more

    def of(self, index: Array | slice) -> Equations:
        """Those of these indices."""
        return self._replace(f=self.f[index], A=self.A[index], u=self.u[index])


class Balls(NamedTuple):
    """Places (n, m) with a solution in a ball about each.

    radius : of the ball that holds a solution; infinite where nothing is proved
    alone : of the ball about the same place that holds no second one
    """

    z: Vectors
    radius: Floats
    alone: Floats


class Enumerated(NamedTuple):
    """Solutions of n systems.

    system : (s,) whose solution it is, in rising order
    t : (s, m) friction [N m or N]
    signs : (s,) their indices, of det(1 - diag(k) dg R); 0 where rounding hides it
    complete : (n,) whether it is proved that these are all
    """

    system: NDArray[np.intp]
    t: Floats
    signs: NDArray[np.int8]
    complete: NDArray[np.bool_]


def paths(contacts: Sequence[int]) -> int:
    """How many solutions, complex ones included, are followed for one system."""
    return int(np.prod([len(CONTACTS[c]) if c else 2 for c in contacts]))


def enumerated(k: Floats, base: Vectors, rows: Vectors, contacts: Sequence[int]) -> Enumerated:
    """All solutions of n systems of m pairs.

    Parameters
    ----------
    k : (n, m) signed Coulomb factors [m] or [-]
    base : (n, m) loads [N] without friction
    rows : (n, m, m) influences of unit friction on the loads
    contacts : number of contacts of each pair: 0 of a pin, 2 of a guide, 4 of one with a length
    """
    n, m = k.shape
    scale = np.abs(base).max(axis=1, initial=0.0)
    scale = np.where(scale > 0.0, scale, 1.0)
    f, A = base / scale[:, None], rows * k[:, None, :]
    idle = (np.abs(f) <= EPS) & (np.abs(A).max(axis=2, initial=0.0) <= EPS)  # never loaded
    if idle.any() and m > 0:
        return _with_idle(k, base, rows, contacts, idle)
    size = max(1, TRACKS // paths(contacts))
    chunks = [slice(i, i + size) for i in range(0, n, size)]
    parts = [_of_chunk(f[part], A[part], contacts, part.start) for part in chunks]
    if not parts:
        return Enumerated(np.zeros(0, np.intp), k, np.zeros(0, np.int8), np.zeros(0, bool))
    system, z, index, complete = map(np.concatenate, zip(*parts, strict=True))
    return Enumerated(system, k[system] * z * scale[system, None], index, complete)


def _with_idle(
    k: Floats, base: Vectors, rows: Vectors, contacts: Sequence[int], idle: NDArray[np.bool_]
) -> Enumerated:
    """Solutions where pairs bear no load, whatever the others do: they have no friction."""
    n, m = k.shape
    parts = []
    for pattern in np.unique(idle, axis=0):
        index, rest = np.flatnonzero((idle == pattern).all(axis=1)), np.flatnonzero(~pattern)
        part = enumerated(
            k[np.ix_(index, rest)],
            base[np.ix_(index, rest)],
            rows[np.ix_(index, rest, rest)],
            [contacts[int(j)] for j in rest],
        )
        t = np.zeros((len(part.system), m))
        t[:, rest] = part.t
        parts.append((index[part.system], t, part.signs, index, part.complete))
    system, t, signs, index, proved = map(np.concatenate, zip(*parts, strict=True))
    order, complete = np.argsort(system, kind="stable"), np.zeros(n, bool)
    complete[index] = proved
    return Enumerated(system[order], t[order], signs[order], complete)


def _of_chunk(f: Vectors, A: Vectors, contacts: Sequence[int], first: int) -> tuple[Array, ...]:
    """System (from ``first`` on), scaled loads, index of each solution; whether they are all."""
    n, m = f.shape
    pieces = np.array(list(itertools.product(*(CONTACTS[c] for c in contacts))), complex)
    pieces = pieces.reshape(-1, m)
    of = np.repeat(np.arange(n), len(pieces))
    u = np.tile(pieces, (n, 1))
    pins = np.array([c == 0 for c in contacts], bool)
    signs = np.array(list(itertools.product(*((1.0, -1.0) if p else (1.0,) for p in pins))))
    signs = signs.reshape(-1, m)
    chance = np.random.default_rng(SEED)
    z = np.zeros((len(of), len(signs), m), complex)
    apart = np.zeros(len(of), bool)
    for attempt in range(ATTEMPTS):
        again = np.flatnonzero(~apart)
        if not len(again):
            break
        bow = np.exp(1j * chance.uniform(0.5, 2.5, m)) * chance.uniform(0.5, 1.0, m)
        bend = chance.uniform(0.5, 1.0) * (1 if attempt % 2 == 0 else -1)
        systems = Equations(f[of[again]], A[of[again]], u[again], bow)
        z[again] = _ends(systems, signs, bend, 0.1**attempt)
        balls = _proved(systems, z[again])
        apart[again] = _apart(balls)
    whole = Equations(f[of], A[of], u, np.zeros(m, complex))
    balls = _proved(whole, z)
    if (open_ := np.flatnonzero(~apart)).size:
        better = _proved(whole.of(open_), z[open_], exactly=True)
        for rough, exact in zip(balls, better, strict=True):
            rough[open_] = exact
        apart[open_] = _apart(better)
    system, loads, found, complete = _judged(whole, balls, apart, of, n, contacts)
    return system + first, loads, found, complete


def _ends(systems: Equations, signs: Floats, bend: float, care: float) -> Vectors:
    """Ends (n, paths, m) of the paths of all signs of the pins' loads at zero friction."""
    n, count, m = len(systems.f), len(signs), signs.shape[1]
    tracks = systems.of(np.repeat(np.arange(n), count))
    start = np.where(
        tracks.u == 0,
        np.sqrt(tracks.f.real**2 + tracks.f.imag**2 + systems.bow),
        tracks.u.real * tracks.f.real + tracks.u.imag * tracks.f.imag,
    )
    z = start * np.tile(signs, (n, 1))
    s, h = np.zeros(len(z)), np.full(len(z), FIRST * care)
    going = np.arange(len(z))
    for _ in range(int(STEPS / care**0.5)):
        if not len(going):
            break
        now = tracks.of(going)
        step = np.minimum(h[going], 1.0 - s[going])
        ahead = _runge_kutta(now, z[going], s[going], step, bend)
        first = _corrected(now, ahead, s[going] + step, bend)
        second = _corrected(now, first, s[going] + step, bend)
        size = 1.0 + np.abs(z[going]).max(axis=1)
        off = np.abs(first - ahead).max(axis=1) / size
        rest = np.abs(second - first).max(axis=1) / size
        good: Array = (off <= GOOD * care) & (rest <= GOOD * np.maximum(off, EPS**0.75))
        z[going[good]] = second[good]
        s[going[good]] += step[good]
        h[going] = np.where(good, np.where(off <= EASY * care, 2.0, 1.0) * step, 0.5 * step)
        going = going[(s[going] < 1.0) & (h[going] > LEAST)]
    for _ in range(4):  # of those that got lost as well: they may be near
        z = _polished(tracks, z)
    return z.reshape(n, count, m)


@np.errstate(all="ignore")
def _polished(tracks: Equations, z: Vectors) -> Vectors:
    better = _corrected(tracks, z, np.ones(len(z)), 0.0)
    good: Any = np.isfinite(better).all(axis=1)
    return np.where(good[:, None], better, z)


def _scale_at(s: Floats, bend: float) -> tuple[Real, Real]:
    """Factor of all friction along the bow, and its rate."""
    return s + 1j * bend * s * (1.0 - s), 1.0 + 1j * bend * (1.0 - 2.0 * s)


def _loads(systems: Equations, z: Real, scale: Real = 1.0) -> tuple[Real, ...]:
    """Components x, y of the loads, and of what friction does to them."""
    ax = np.einsum("njm,nm->nj", systems.A.real, z)
    ay = np.einsum("njm,nm->nj", systems.A.imag, z)
    scale = np.asarray(scale)[..., None]
    return systems.f.real + scale * ax, systems.f.imag + scale * ay, ax, ay


def _lines(systems: Equations, z: Vectors, s: Real, scale: Real) -> tuple[Real, Real, Real]:
    """Misfit (n, m) of the equations, its slope (n, m, m) by z, and by the factor of friction."""
    x, y, ax, ay = _loads(systems, z, scale)
    pin, u = systems.u == 0, systems.u
    excess = np.multiply.outer(1.0 - np.asarray(s), systems.bow)
    misfit = np.where(pin, z * z - x * x - y * y - excess, z - u.real * x - u.imag * y)
    wx, wy = np.where(pin, 2.0 * x, u.real), np.where(pin, 2.0 * y, u.imag)
    by = -(wx * ax + wy * ay)
    scale = np.asarray(scale)[..., None, None]
    slope: Floats = -scale * (wx[..., None] * systems.A.real + wy[..., None] * systems.A.imag)
    m = z.shape[1]
    slope[:, range(m), range(m)] += np.where(pin, 2.0 * z, 1.0)
    return misfit, slope, by


def _solved(slope: Array, right: Array) -> Array:
    """Solutions of n systems; NaN where one is singular."""
    try:
        solution = np.linalg.solve(slope, right[..., None])[..., 0]
    except np.linalg.LinAlgError:  # of one of them; LAPACK does not say of which
        bad = np.linalg.det(slope) == 0.0
        slope = np.where(bad[:, None, None], np.eye(slope.shape[1]), slope)
        solution = np.linalg.solve(slope, np.where(bad[:, None], np.nan, right)[..., None])[..., 0]
    return solution


def _corrected(systems: Equations, z: Vectors, s: Floats, bend: float) -> Vectors:
    """One step of Newton's method."""
    misfit, slope, _ = _lines(systems, z, s, _scale_at(s, bend)[0])
    better: Vectors = z - _solved(slope, misfit)
    return better


def _rates(systems: Equations, z: Vectors, s: Floats, bend: float) -> Vectors:
    """dz/ds along the bow."""
    scale, rate = _scale_at(s, bend)
    _, slope, by = _lines(systems, z, s, scale)
    right = rate[..., None] * by + np.where(systems.u == 0, systems.bow, 0.0)
    rates: Vectors = -_solved(slope, right)
    return rates


@np.errstate(all="ignore")
def _runge_kutta(systems: Equations, z: Vectors, s: Floats, h: Floats, bend: float) -> Vectors:
    step = h[:, None]
    a = _rates(systems, z, s, bend)
    b = _rates(systems, z + step / 2 * a, s + h / 2, bend)
    c = _rates(systems, z + step / 2 * b, s + h / 2, bend)
    d = _rates(systems, z + step * c, s + h, bend)
    return z + step / 6 * (a + 2 * b + 2 * c + d)


# -- what is proved -----------------------------------------------------------------------


@np.errstate(all="ignore")
def _proved(systems: Equations, z: Vectors, exactly: bool = False) -> Balls:
    """Balls about ends (n, paths, m), by Newton-Kantorovich's theorem in the maximum norm.

    ``exactly`` : with misfits in rational numbers, and ends that these correct

    With C the computed inverse of the slope J: |C misfit| + rounding = b, |1 - C J| = d, and
    |C J'| = w for the constant second derivative J'. If (1 - d)^2 > 2 w b, a solution is
    within 2 b / (1 - d + root), and none else within (1 - d) / w.
    """
    n, count, m = z.shape
    tracks, flat = systems.of(np.repeat(np.arange(n), count)), z.reshape(-1, m)
    misfit, slope, _ = _lines(tracks, flat, np.ones(len(flat)), np.ones(len(flat)))
    bad = ~np.isfinite(slope).all(axis=(1, 2)) | (np.abs(np.linalg.det(slope)) < 1e-290)
    slope[bad] = np.eye(m)
    inverse = np.linalg.inv(slope)
    if exactly:  # iterative refinement: a step leaves what the ends are rounded by
        flat = flat - np.einsum("njm,nm->nj", inverse, _exact_misfit(tracks, flat))
        misfit, z = _exact_misfit(tracks, flat), flat.reshape(z.shape)
        _, slope, _ = _lines(tracks, flat, np.ones(len(flat)), np.ones(len(flat)))
    pin = tracks.u == 0
    sums = np.abs(tracks.A.real).sum(axis=2), np.abs(tracks.A.imag).sum(axis=2)
    bend = np.where(pin, 2.0 * (1.0 + sums[0] ** 2 + sums[1] ** 2), 0.0)
    size = np.abs(tracks.f) + np.einsum("njm,nm->nj", np.abs(tracks.A), np.abs(flat))
    terms = np.where(pin, np.abs(flat) ** 2 + 2.0 * size**2, np.abs(flat) + 2.0 * size)
    C = np.abs(inverse)
    change = np.abs(np.einsum("njm,nm->nj", inverse, misfit))
    terms = np.abs(misfit) if exactly else 4.0 * terms
    rounding = (m + 4) * EPS * np.einsum("njm,nm->nj", C, terms)
    b = (change + rounding).max(axis=1)
    d = np.abs(np.eye(m) - inverse @ slope).sum(axis=2).max(axis=1) + 8.0 * m * EPS * (
        (C @ np.abs(slope)).sum(axis=2).max(axis=1)
    )
    w = np.einsum("njm,nm->nj", C, bend).max(axis=1)
    root = (1.0 - d) ** 2 - 2.0 * w * b
    proved = (d < 1.0) & (root > 0.0) & ~bad
    root = np.sqrt(np.where(proved, root, 0.0))
    radius = np.where(proved, 2.0 * b / (1.0 - d + root), np.inf)
    alone = np.where(proved, np.where(w > 0.0, (1.0 - d) / np.where(w > 0.0, w, 1.0), np.inf), 0.0)
    return Balls(z, radius.reshape(n, count), alone.reshape(n, count))


def _exact_misfit(systems: Equations, z: Vectors) -> Vectors:
    """Misfit (n, m) of the equations, rounded once."""
    misfits = np.full(z.shape, np.nan, complex)
    for n in np.flatnonzero(np.isfinite(z).all(axis=1)):
        re, im = ([Fraction(x) for x in part] for part in (z[n].real.tolist(), z[n].imag.tolist()))
        for j, u in enumerate(systems.u[n].tolist()):
            f, A = systems.f[n, j], systems.A[n, j]
            loads = []  # its components x and y, each real and imaginary
            for first, row in ((f.real, A.real), (f.imag, A.imag)):
                a = [Fraction(x) for x in row.tolist()]
                real, imaginary = (
                    sum((p * q for p, q in zip(a, part, strict=True)), Fraction(0))
                    for part in (re, im)
                )
                loads.append((Fraction(float(first)) + real, imaginary))
            (xr, xi), (yr, yi) = loads
            if u == 0:
                real = re[j] ** 2 - im[j] ** 2 - xr**2 + xi**2 - yr**2 + yi**2
                imaginary = 2 * (re[j] * im[j] - xr * xi - yr * yi)
            else:
                c, s = Fraction(u.real), Fraction(u.imag)
                real, imaginary = re[j] - c * xr - s * yr, im[j] - c * xi - s * yi
            misfits[n, j] = complex(real, imaginary)
    return misfits


def _apart(balls: Balls) -> NDArray[np.bool_]:
    """(n,) whether all balls are proved and none touches another."""
    z, radius, _ = balls
    with np.errstate(invalid="ignore"):
        distance = np.abs(z[:, :, None] - z[:, None]).max(axis=3, initial=0.0)
        free = distance > radius[:, :, None] + radius[:, None]
    free |= np.eye(z.shape[1], dtype=bool)
    apart: NDArray[np.bool_] = free.all(axis=(1, 2)) & np.isfinite(radius).all(axis=1)
    return apart


@np.errstate(all="ignore")
def _judged(
    systems: Equations,
    balls: Balls,
    apart: NDArray[np.bool_],
    of: NDArray[np.intp],
    n: int,
    contacts: Sequence[int],
) -> tuple[NDArray[np.intp], Floats, NDArray[np.int8], NDArray[np.bool_]]:
    """The ends that are solutions: real, z > 0, guides pressed as chosen; and what is open."""
    count, m = balls.z.shape[1:]
    tracks = systems.of(np.repeat(np.arange(len(of)), count))
    z, radius, alone = balls.z.reshape(-1, m), balls.radius.ravel(), balls.alone.ravel()
    aside = np.abs(z.imag).max(axis=1, initial=0.0)
    size = 1.0 + np.abs(z).max(axis=1, initial=0.0)
    real, almost_real = 2.0 * aside + radius < alone, aside <= BLUR * size
    spare = _spare(tracks, z.real, contacts)
    reach = (1.0 + np.abs(tracks.A).sum(axis=2)) * radius[:, None]  # a ball's, seen by a load
    refused = (aside > radius) | (real & (spare < -reach).any(axis=1))
    accepted = real & (spare > reach).all(axis=1)
    open_ = ~(refused | accepted)
    doubtful = open_ & almost_real & (spare >= -BLUR * size[:, None]).all(axis=1)
    doubtful &= _misfit(tracks, z.real, contacts) <= BLUR**1.5 * size
    slope = _lines(tracks, z.real.astype(complex), np.ones(len(z)), 1.0)[1].real
    signs = np.sign(np.linalg.det(slope))
    owner = np.repeat(of, count)
    complete = np.ones(n, bool)
    complete[of[~apart]] = False
    complete[owner[open_]] = False
    selected = list(np.flatnonzero(accepted))
    for i in np.flatnonzero(doubtful):
        neighbours = [j for j in selected if owner[j] == owner[i]]
        if all(np.abs(z[i] - z[j]).max() > BLUR * size[i] for j in neighbours):
            selected.append(i)
    order = np.array(sorted(selected, key=lambda i: (owner[i], i)), np.intp)
    index = np.where(accepted[order], signs[order], 0.0).astype(np.int8)
    return owner[order], z.real[order], index, complete


def _spare(systems: Equations, z: Floats, contacts: Sequence[int]) -> Floats:
    """(n, m) what is positive at a solution: loads, and by what they exceed a guide's other one."""
    x, y, _, _ = _loads(systems, z)
    smaller = np.abs(systems.u.real * y - systems.u.imag * x)
    edges = np.array([c == 4 for c in contacts], bool)
    return np.where(edges, np.minimum(z, z - smaller), z)


def _misfit(systems: Equations, z: Floats, contacts: Sequence[int]) -> Floats:
    """(n,) largest difference of z from the norms of the loads that it brings."""
    x, y, _, _ = _loads(systems, z)
    pins = np.array([c == 0 for c in contacts], bool)
    edges = np.array([c == 4 for c in contacts], bool)
    guides = np.where(edges, np.maximum(np.abs(x), np.abs(y)), np.abs(x))
    off: Floats = np.abs(z - np.where(pins, np.hypot(x, y), guides)).max(axis=1, initial=0.0)
    return off
