"""Instantaneous kinematics of one driver: centres of rotation, ratios, curvature of paths.

Nothing here depends on how fast the driver goes, so all is read at unit rate:

    centre of link 2 against link 1   P where v1(P) = v2(P)
    velocity ratio of two places      |v| or om of one over that of the other; of a link that
                                      slides |v|, of any other om
    radius of curvature of a path     |v|^3 / cross(v, a), positive where it turns left

Mechanical advantage between two places is the inverse of their velocity ratio, where nothing
is lost and nothing else works (power balance). Whether a path is straight, its places tell.

Source: Hunt, Kinematic Geometry of Mechanisms, 1978; Norton, Design of Machinery, ch. 6.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from blockmech.ground.arguments import declared
from blockmech.ground.errors import RequestError, among, listed, refused, unknown_name
from blockmech.ground.plane import EPS
from blockmech.ground.tolerances import EQUAL, ROUNDING
from blockmech.model.structure import JointRef
from blockmech.typing import Array, Complex, Coordinates, Real, Vectors

if TYPE_CHECKING:
    from blockmech.compiled import Compiled

FRAME = "frame"
RATES = {"q": "rate", "coordinate": "slip", "angle": "omega", "p": "v"}
"""Coordinate -> its rate."""


@declared
def instant_centre(mechanism: Compiled, link: str, other: str = FRAME, *, at: Coordinates) -> Array:
    """Instant centres of a link's motion against another one.

    Parameters
    ----------
    link, other : links such as ``"dyad.i"``, in a document of links their names; or "frame"
    at : coordinates (n,) of the driver [rad or m]

    Returns
    -------
    (n,) complex places [m] in the axes of the frame; infinite where the links do not turn
    against each other. For successive ``at`` they trace the fixed centrode.

    Raises
    ------
    RequestError for an unknown link, or a mechanism of several drivers

    >>> mech.instant_centre("dyad.i", at=0.5).round(6)
    array([12.485132+6.820659j])
    """
    one, two = (_link(mechanism, name, at) for name in (other, link))
    turning = two[2] - one[2]
    with np.errstate(all="ignore"):
        gap = (two[1] - 1j * two[2] * two[0]) - (one[1] - 1j * one[2] * one[0])
        centre = 1j * gap / turning
    return np.where(np.isfinite(centre), centre, complex(np.inf, np.inf))


@declared
def velocity_ratio(mechanism: Compiled, of: str, by: str, *, at: Coordinates) -> Array:
    """Ratio of the speeds of two links, points or drivers, as magnitudes.

    Parameters
    ----------
    of, by : a link (its angular speed; of one that only slides its speed), a point such as
        ``"dyad.C"`` (its speed), a driver, or a coordinate such as ``"joint.B.p.x"`` (its rate)
    at : coordinates (n,) of the driver [rad or m]

    Returns
    -------
    (n,) ratios in SI units; infinite where ``by`` is at rest

    Raises
    ------
    RequestError for names of nothing that moves, or a mechanism of several drivers

    >>> mech.velocity_ratio("dyad.j", "crank", at=0.5).round(6)
    array([0.368747])
    """
    first, second = (_rate(mechanism, name, at) for name in (of, by))
    with np.errstate(all="ignore"):
        return np.asarray(first / second)


@declared
def mechanical_advantage(mechanism: Compiled, of: str, by: str, *, at: Coordinates) -> Array:
    """Output force or moment over the input one that balances it, without losses.

    Of a link that slides, or a point, it is the force along its velocity. The inverse of
    `velocity_ratio`, with its arguments.

    >>> mech.mechanical_advantage("dyad.j", "crank", at=0.5).round(6)
    array([2.711884])
    """
    return velocity_ratio(mechanism, by, of, at=at)


@declared
def path_radius(mechanism: Compiled, point: str, *, at: Coordinates) -> Array:
    """Radii of curvature (n,) [m] of a point's path, positive where it turns left.

    Infinite where the path is straight, 0 at a cusp.

    >>> mech.path_radius("dyad.S", at=0.5).round(6)
    array([1.073348])
    """
    name = point if mechanism.names is None else f"link.{point}"
    run = _moving(mechanism, at, [f"{name}.v", f"{name}.a"], point)
    v, a = run[f"{name}.v"], run[f"{name}.a"]
    across = (np.conj(v) * a).imag
    with np.errstate(all="ignore"):
        straight = np.abs(across) <= ROUNDING * np.abs(v) * np.abs(a)
        radius = np.abs(v) ** 3 / np.where(straight, np.nan, across)
    return np.where(v == 0, 0.0, np.where(straight, np.inf, radius))


def _link(mechanism: Compiled, link: str, at: Coordinates) -> tuple[Complex, Complex, Real]:
    """Place and velocity of a point of a link, and its rate."""
    if link == FRAME:
        return 0j, 0j, 0.0
    name = link if mechanism.names is None else f"link.{link}"
    names = [f"{name}.p", f"{name}.v", f"{name}.omega"]
    run = _moving(mechanism, at, names, link)
    return run[names[0]], run[names[1]], run[names[2]]


def _rate(mechanism: Compiled, name: str, at: Coordinates) -> Real:
    outputs = mechanism.outputs
    path, axis = (name[:-2], name[-2:]) if name.endswith((".x", ".y")) else (name, "")
    owner, _, coordinate = path.rpartition(".")
    rates = [f"{owner}.{RATES[coordinate]}"] if coordinate in RATES else []
    quantities = ("v", "omega", "rate") if _slides(mechanism, name) else ("rate", "omega", "v")
    owners = [f"{section}{path}" for section in ("", "driver.", "link.", "joint.")]
    rates += [f"{owner}.{quantity}" for quantity in quantities for owner in owners]
    rate = next((rate for rate in rates if rate in outputs), None)
    if rate is None:
        moving = {o.rpartition(".")[0]: None for o in outputs if o.endswith((".v", ".rate"))}
        kind = "moving link, point or driver"
        raise RequestError(unknown_name("unknown-output", kind, name, name, moving))
    run = _moving(mechanism, at, [rate], name)
    return np.abs(getattr(run[rate], {".x": "real", ".y": "imag"}[axis]) if axis else run[rate])


def _slides(mechanism: Compiled, name: str) -> bool:
    """Whether a link is held by prismatic pairs, one after the other, to the frame."""
    structure, names = mechanism.structure, mechanism.names
    links = {str(link): link for link in structure.links}
    links |= {} if names is None else {n: x.link for n, x in names.links.items()}
    joints = (JointRef(name, joint) for name, b in structure.blocks.items() for joint in b.joints)
    guides = [ref for ref in joints if not structure.joint(ref).rotary]
    pairs = [{structure.earlier_link(ref), structure.later_link(ref)} for ref in guides]
    sliding = {structure.frame_link}
    for _ in pairs:
        sliding = sliding.union(*(pair for pair in pairs if pair & sliding))
    return links.get(name.removeprefix("link.")) in sliding


def _moving(mechanism: Compiled, at: Coordinates, names: list[str], where: str) -> Any:
    among(mechanism.outputs, "output", names, "unknown-output", where)
    if len(mechanism.drivers) != 1:
        found = f"the mechanism has {len(mechanism.drivers)} drivers: {listed(mechanism.drivers)}"
        raise refused("at", found, valid="instantaneous ratios are of one driver")
    return mechanism.run(at=at, rates=1.0, accelerations=0.0, want=names)


def principal_axes(z: Vectors) -> tuple[Vectors, Vectors, NDArray[np.bool_]]:
    """Lines through the places (m, n) of m markers at n poses.

    Returns a place (m,) on each line, its unit direction (m,), 0 of a marker that does not move,
    and whether the marker stays on it.
    """
    m, first = np.arange(len(z)), z[:, 0]
    middle = (z[m, np.abs(z - first[:, None]).argmax(axis=1)] + first) / 2
    off = z - middle[:, None]
    spread = np.abs(off).max(axis=1)
    moves = spread > EPS * np.abs(z).max(axis=1)
    # the square forgets which way along the axis places lie
    u = np.sqrt(np.where(moves, (off**2).sum(axis=1), 0.0))
    u /= np.where(moves, np.abs(u), 1.0)
    aside = np.abs((off * u.conj()[:, None]).imag).max(axis=1)
    return middle, u, moves & (aside <= EQUAL * spread)
