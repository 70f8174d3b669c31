"""A four-bar whose coupler point passes through six points at given crank angles.

Least squares by SciPy on a study point, with its exact Jacobian.
"""

import numpy as np
from scipy.optimize import least_squares

import blockmech as bm
from blockmech.draw.paper import new_figure, write_figure

ANGLES = np.radians([0, 40, 80, 120, 160, 200])
POINTS = np.array([0.5 + 2.2j, 0.9 + 2.9j, 0.4 + 3.2j, -0.4 + 3.1j, -1.2 + 2.6j, -1.6 + 2.0j])
NUMBERS = ["crank.length", "dyad.l_i", "dyad.l_j", "dyad.P.x", "dyad.P.y"]
NUMBERS += ["crank.offset", "frame.A.x", "frame.A.y", "frame.D.x", "frame.D.y"]


def fourbar() -> bm.Graph:
    """Where the search starts."""
    g = bm.Graph("path_generator", drive={"crank": bm.ConstantRate(rate=1.0)})
    g.add("frame", bm.Frame(markers={"A": (0.0, 0.5), "D": (3.0, 0.5)}))
    g.add("crank", bm.Crank(length=1.0))
    g.add("dyad", bm.RRR(l_i=3.0, l_j=2.5, links={"i": bm.Link(markers={"P": (1.0, 1.5)})}))
    g.connect("frame.A", "crank.A")
    g.connect("crank.B", "dyad.B")
    g.connect("frame.D", "dyad.D")
    return g


if __name__ == "__main__":
    path = fourbar().compile().objective(NUMBERS, want="poses(dyad.P.p)", over=ANGLES)
    wanted = np.concatenate([POINTS.real, POINTS.imag])
    found = least_squares(lambda x: path(x) - wanted, path.start, jac=path.jacobian)
    print(f"largest miss: {np.abs(found.fun).max() * 1e3:.1f} mm after {found.nfev} designs")
    best = fourbar().replace(path.numbers(found.x)).run(samples=181, want="dyad.P.p")
    figure = new_figure(240, 200, layout="constrained")
    axes = figure.subplots()
    axes.plot(best["dyad.P.p"].real, best["dyad.P.p"].imag, label="coupler curve")
    axes.plot(POINTS.real, POINTS.imag, "o", mfc="none", label="wanted")
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.legend(loc="lower right", frameon=False)
    write_figure(figure, "coupler_curve.png")
