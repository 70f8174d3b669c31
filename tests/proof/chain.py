"""A chain of RRR dyads given as links and joints, and its forces by a recursion of its own.

Rods and rockers are near parallelograms, so that motion neither dies out nor grows along the
chain. The recursion runs in thirty digits and shares nothing with blockmech: it knows that
each rod hangs between two rockers, places them one after the other, and takes the forces
from the last rocker back to the crank.
"""

from __future__ import annotations

import cmath
import random
from dataclasses import dataclass

from mpmath import mp, mpc, mpf

GRAVITY = (0.4, -9.81)
HOME = 1.1  # [rad] angle of the crank in the given pose
MASSES = {"crank": (2.0, 0.3, 0.5), "rod": (1.0, 0.2, 1.0), "rocker": (1.5, 0.25, 0.45)}
TIP = complex(0.9, 0.12)  # place on a rocker where the next rod is pinned


@dataclass(frozen=True)
class Cell:
    """A dyad of the chain: rod and rocker lengths, the pivot, and the side of the knee."""

    rod: float
    rocker: float
    pivot: complex
    side: int


def cells_of(number, seed=0):
    """Cells that close with the crank at ``HOME``, and their poses (place, angle) there."""
    chance = random.Random(seed)
    start, cells, poses = cmath.rect(1.0, HOME), [], []
    for k in range(1, number + 1):
        pivot = complex(2.0 * k, chance.uniform(-0.1, 0.1))
        angle = HOME + chance.uniform(-0.15, 0.15)
        rocker = chance.uniform(0.95, 1.05)
        knee = pivot + cmath.rect(rocker, angle)
        side = 1 if ((pivot - start).conjugate() * (knee - start)).imag > 0 else -1
        cells.append(Cell(abs(knee - start), rocker, pivot, side))
        poses += [(start, cmath.phase(knee - start)), (pivot, angle)]
        start = pivot + TIP * cmath.rect(1.0, angle)
    return cells, poses


def document(number, seed=0):
    """The chain as links and joints, in shuffled order."""
    cells, poses = cells_of(number, seed)
    chance = random.Random(seed)
    links = [("crank", _link("crank", 0j, HOME))]
    joints = [("O", _pin("frame", 0j, "crank", 0j))]
    before, at = "crank", 1.0 + 0j
    for k, cell in enumerate(cells):
        rod, rocker = f"rod{k:04}", f"rocker{k:04}"
        links.append((rod, _link("rod", *poses[2 * k])))
        links.append((rocker, _link("rocker", *poses[2 * k + 1])))
        joints.append((f"B{k:04}", _pin(before, at, rod, 0j)))
        joints.append((f"C{k:04}", _pin(rod, complex(cell.rod), rocker, complex(cell.rocker))))
        joints.append((f"D{k:04}", _pin("frame", cell.pivot, rocker, 0j)))
        before, at = rocker, TIP
    chance.shuffle(links)
    chance.shuffle(joints)
    return {
        "format": "blockmech/joints",
        "version": 1,
        "name": "chain",
        "gravity": list(GRAVITY),
        "links": dict(links),
        "joints": dict(joints),
        "drivers": {"motor": {"joint": "O"}},
    }


def _link(kind, o, angle):
    mass, inertia, along = MASSES[kind]
    pose = [round(o.real, 4), round(o.imag, 4), round(angle, 4)]
    return {"mass": mass, "inertia": inertia, "cm": [along, 0.0], "pose": pose}


def _pin(first, at, second, there):
    at = [[z.real, z.imag] for z in (at, there)]
    return {"type": "R", "links": [first, second], "at": at}


# ---- the recursion --------------------------------------------------------------------------


def recursion(number, q, rate, acceleration, seed=0):
    """Reactions [N] by joint, each of the first link on the second, and the driving moment."""
    with mp.workdps(30):
        return _recursion(cells_of(number, seed)[0], mpf(q), mpf(rate), mpf(acceleration))


@dataclass
class _Turning:
    """A link that turns: origin, direction, rates, the origin's acceleration."""

    o: mpc
    e: mpc
    om: mpf
    al: mpf
    v: mpc
    a: mpc

    def point(self, z):
        """Place, velocity and acceleration of a place on the link."""
        arm = self.e * z
        return (
            self.o + arm,
            self.v + 1j * self.om * arm,
            self.a + (1j * self.al - self.om**2) * arm,
        )

    def load(self, kind):
        """Inertia force with weight [N] at the centre of mass, its arm, and the couple."""
        mass, inertia, along = map(mpf, MASSES[kind])
        _, _, a = self.point(along)
        return mass * (a - mpc(*GRAVITY)), self.e * along, inertia * self.al


def _recursion(cells, q, rate, acceleration):
    crank = _Turning(mpc(0), mp.expjpi(q / mp.pi), rate, acceleration, mpc(0), mpc(0))
    start, links = crank.point(mpf(1)), []
    for cell in cells:
        rod, rocker = _dyad(cell, *start)
        links.append((rod, rocker))
        start = rocker.point(mpc(TIP))
    found, pull = {}, mpc(0)  # what the next rod takes from the tip of the last rocker
    for k in reversed(range(len(cells))):
        rod, rocker = links[k]
        u, w = rod.e * mpf(cells[k].rod), rocker.e * mpf(cells[k].rocker)
        f_i, arm_i, m_i = rod.load("rod")
        f_j, arm_j, m_j = rocker.load("rocker")
        # Moments about B and about D with the force C of the rod on the rocker.
        on_i = m_i + _cross(arm_i, f_i)
        on_j = m_j + _cross(arm_j, f_j) + _cross(rocker.e * mpc(TIP), pull)
        # -u x C = on_i and w x C = on_j
        C = -(u * on_j + w * on_i) / _cross(u, w)
        found[f"C{k:04}"] = C
        found[f"D{k:04}"] = f_j + pull - C
        pull = f_i + C
        found[f"B{k:04}"] = pull
    f, arm, m = crank.load("crank")
    found["O"] = f + pull
    moment = m + _cross(arm, f) + _cross(crank.e, pull)
    return {name: complex(force) for name, force in found.items()}, float(moment)


def _cross(a, b):
    return a.real * b.imag - a.imag * b.real


def _dot(a, b):
    return a.real * b.real + a.imag * b.imag


def _dyad(cell, B, v_B, a_B):
    """The rod from B and the rocker on its pivot."""
    l, r, D = mpf(cell.rod), mpf(cell.rocker), mpc(cell.pivot)
    d = D - B
    along = (l**2 - r**2 + abs(d) ** 2) / (2 * abs(d))
    u = d / abs(d) * mpc(along, cell.side * mp.sqrt(l**2 - along**2))
    w = B + u - D
    det = _cross(u, w)
    # v_B + i om u = i om_j w, seen along w and along u
    om, om_j = -_dot(v_B, w) / det, -_dot(v_B, u) / det
    a = a_B - om**2 * u + om_j**2 * w
    al, al_j = -_dot(a, w) / det, -_dot(a, u) / det
    rod = _Turning(B, u / l, om, al, v_B, a_B)
    return rod, _Turning(D, w / r, om_j, al_j, mpc(0), mpc(0))
