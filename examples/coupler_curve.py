"""A four-bar whose coupler point passes through six points.

With the crank's angles given, six points ask more of a four-bar than it has numbers; with the
timing free `blockmech.synthesis` finds designs that pass through all of them.
"""

import numpy as np

import blockmech as bm
from blockmech.figures.paper import new_figure, write_figure

ANGLES = np.radians([0, 40, 80, 120, 160, 200])
POINTS = np.array([0.5 + 2.2j, 0.9 + 2.9j, 0.4 + 3.2j, -0.4 + 3.1j, -1.2 + 2.6j, -1.6 + 2.0j])


def designs() -> dict[str, bm.synthesis.Design]:
    """The best four-bar with the angles given, and the best with its timing free."""
    asked = {"angles given": ANGLES, "timing free": None}
    return {name: bm.synthesis.path_generator(POINTS, at)[0] for name, at in asked.items()}


if __name__ == "__main__":
    figure = new_figure(240, 200, layout="constrained")
    axes = figure.subplots()
    for label, design in designs().items():
        print(f"{label}: largest miss {design.miss * 1e3:.1f} mm")
        way = np.linspace(design.at[0], design.at[-1], 181)
        path = design.graph.run(at=way, want="dyad.P.p")["dyad.P.p"]
        axes.plot(path.real, path.imag, label=label)
    axes.plot(POINTS.real, POINTS.imag, "o", mfc="none", label="wanted")
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.legend(loc="lower center", frameon=False)
    write_figure(figure, "coupler_curve.png")
