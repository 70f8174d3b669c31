"""The number of real modes of an RRR triad, counted exactly and by another elimination.

The unknown is the angle of leg 1 (not that of the platform), a rational function of
t = tan(half of it). The pin it carries leaves two conditions that are linear in the
platform's direction e, and |e| = 1 is a polynomial of degree 8 in t. All numbers are
rational, so Sturm's theorem counts its real roots without any rounding. The angle is
measured from a rational direction, so that no mode sits at the pole of t.
"""

import itertools
from fractions import Fraction

POLE = (Fraction(-20, 29), Fraction(21, 29))  # a unit vector: cos and sin


def count_exactly(pivots, lengths, pins):
    """Distinct angles of leg 1 at which the triad closes, for the doubles as they are given."""
    p, s = _eliminant(pivots, lengths, pins)
    assert s == 0
    chain = [p, _derived(p)]
    while chain[-1]:
        chain.append(_primitive([-x for x in _remainder(chain[-2], chain[-1])]))
    chain.pop()
    return _changes(chain, -1) - _changes(chain, 1)


def _eliminant(pivots, lengths, pins):
    """Polynomial in t, highest power first, and its imaginary part, which is zero."""
    g = [_sub(_exact(z), _exact(pivots[0])) for z in pivots]
    p = [_sub(_exact(z), _exact(pins[0])) for z in pins]
    l = [Fraction(x) for x in lengths]
    q = [Fraction(1), Fraction(0), Fraction(1)]  # 1 + t^2, the common denominator
    turn = ([-1, 0, 1], [0, 2, 0])  # (1 - t^2) + 2 t i
    a = tuple([l[0] * x for x in part] for part in _times(_constant(POLE), turn))
    row = {}
    for k in (1, 2):
        arm = _minus(a, tuple([x * c for x in q] for c in g[k]))
        alpha = _times(_constant(p[k]), _conjugate(arm))
        apart = _norm(g[k]) + l[0] * l[0]
        along = _times(a, _conjugate(_constant(g[k])))[0]  # Re(a conj g)
        beta = _plus_real(
            [(l[k] * l[k] - _norm(p[k]) - apart) * x for x in q], [2 * x for x in along]
        )
        row[k] = (alpha, (beta, [Fraction(0)]))
    (a2, b2), (a3, b3) = row[1], row[2]
    top = _minus(_times(b2, _conjugate(a3)), _times(b3, _conjugate(a2)))
    below = _minus(_times(a2, _conjugate(a3)), _times(a3, _conjugate(a2)))
    whole = _minus(_times(top, _conjugate(top)), _times(below, _conjugate(below)))
    return _primitive(whole[0]), max(map(abs, whole[1]), default=0)


# ---- rational complex polynomials: pairs of coefficient lists ----------------------------


def _exact(z):
    z = complex(z)
    return Fraction(z.real), Fraction(z.imag)


def _sub(a, b):
    return a[0] - b[0], a[1] - b[1]


def _norm(z):
    return z[0] * z[0] + z[1] * z[1]


def _constant(z):
    return [z[0]], [z[1]]


def _conjugate(z):
    return z[0], [-x for x in z[1]]


def _product(a, b):
    out = [Fraction(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            out[i + j] += x * y
    return out


def _plus_real(a, b):
    n = max(len(a), len(b))
    a, b = [Fraction(0)] * (n - len(a)) + list(a), [Fraction(0)] * (n - len(b)) + list(b)
    return [x + y for x, y in zip(a, b, strict=True)]


def _times(a, b):
    real = _plus_real(_product(a[0], b[0]), [-x for x in _product(a[1], b[1])])
    return real, _plus_real(_product(a[0], b[1]), _product(a[1], b[0]))


def _minus(a, b):
    return tuple(_plus_real(x, [-v for v in y]) for x, y in zip(a, b, strict=True))


# ---- Sturm's theorem ---------------------------------------------------------------------


def _derived(p):
    n = len(p) - 1
    return _primitive([x * (n - i) for i, x in enumerate(p[:-1])])


def _primitive(p):
    """Without leading zeros, divided by a positive number that keeps it small."""
    while p and p[0] == 0:
        p = p[1:]
    if not p:
        return []
    scale = max(map(abs, p))
    return [x / scale for x in p]


def _remainder(a, b):
    a = list(a)
    while len(a) >= len(b):
        factor = a[0] / b[0]
        for i, x in enumerate(b):
            a[i] -= factor * x
        a = a[1:]
    return a


def _changes(chain, end):
    """Changes of sign along the chain towards t = -inf (end -1) or +inf."""
    signs = [(1 if p[0] > 0 else -1) * (end if (len(p) - 1) % 2 else 1) for p in chain]
    return sum(a != b for a, b in itertools.pairwise(signs))
