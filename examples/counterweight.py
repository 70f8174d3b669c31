"""Where counterweights on crank and rocker make a four-bar shake its frame the least.

Their mass is given; SciPy finds the places of the centres of mass, with exact gradients.
"""

import numpy as np
from scipy.optimize import minimize
from wire_ruiz import fourbar

import blockmech as bm
from blockmech.figures.paper import new_figure, write_figure

HEAVIER = {"crank.links.crank.mass": 30.0, "dyad.links.j.mass": 40.0}
PLACES = ["crank.links.crank.cm.x", "crank.links.crank.cm.y"]
PLACES += ["dyad.links.j.cm.x", "dyad.links.j.cm.y"]
SHAKING = "mechanism.shaking_force"


def balanced() -> tuple[bm.Graph, dict[str, float], int]:
    """The heavier four-bar, the best places of its masses, and how often it was asked."""
    graph = fourbar().replace(HEAVIER)
    shaking = graph.compile().objective(PLACES, want=f"rms({SHAKING})", samples=73)
    found = minimize(shaking, shaking.start, jac=shaking.jacobian)
    return graph, shaking.numbers(found.x), found.nfev


if __name__ == "__main__":
    graph, places, asked = balanced()
    figure = new_figure(240, 160, layout="constrained")
    axes = figure.subplots()
    for label, g in (("as it is", fourbar()), ("counterweights", graph.replace(places))):
        run = g.run(samples=361, want=SHAKING)
        force = np.abs(run[SHAKING]) / 1e3
        print(f"{label}: {np.sqrt(np.mean(force**2)):.2f} kN rms, {force.max():.2f} kN at most")
        axes.plot(np.degrees(run.drivers["crank.q"]), force, label=label)
    print(f"{asked} designs: " + ", ".join(f"{a} = {x:.3f} m" for a, x in places.items()))
    axes.set(xlabel="crank [deg]", ylabel="shaking force [kN]")
    axes.legend(frameon=False)
    write_figure(figure, "counterweight.png")
