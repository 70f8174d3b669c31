"""The curves of both papers, redrawn: python examples/papers.py [FOLDER]."""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import blockmech as bm

FOLDER, GRAPHS = Path(*sys.argv[1:2]), Path(__file__).parents[1] / "graphs"
FRICTION = {"drive": "N m", "mechanism.friction_power": "W", "D.reaction": "N"}
MOTION = {"crank.q": "rad", "crank.rate": "rad/s", "crank.A.reaction": "N"}
ENERGY = {"kinetic_energy": "J", "potential_energy": "J", "sum": "J"}


def draw(name: str, x: str, units: dict[str, str], curves: dict[str, tuple]) -> None:
    """One panel an output; ``curves``: label -> abscissae and the outputs by name."""
    figure = Figure(figsize=(7, 2.6 * len(units)), layout="constrained")
    for axes, (output, unit) in zip(figure.subplots(len(units)), units.items(), strict=True):
        for (label, (at, found)), style in zip(curves.items(), ("-", "--", ":"), strict=False):
            y = next(found[name] for name in found if name.endswith(output))
            axes.plot(at, abs(y) if unit == "N" else y, style, label=label)
        axes.set(xlabel=x, ylabel=f"{output} [{unit}]")
    axes.legend()
    figure.savefig(FOLDER / name)


ruiz = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").compile()  # Figs. 12 to 14 of 2010
links = bm.Linkage.load(GRAPHS / "joints" / "ruiz_fourbar.json").decompose("one").compile()
runs = {"successive": ruiz.run(friction="successive"), "none": ruiz.run(friction="none")}
runs["all links at once, no groups"] = links.run()
found = {label: (run.drivers[next(iter(run.drivers))], run) for label, run in runs.items()}
draw("ruiz_12_to_14.png", "crank angle [rad]", FRICTION, found)
watt, want = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile(), [*MOTION, "mechanism.*_energy"]
for how, step in (("euler_q", 1e-3), ("energy", None)):  # Figs. 6 and 7 of 2014
    run = watt.simulate("standstill", method=bm.FixedStep(how, step), want=want)
    total = run["mechanism.kinetic_energy"] + run["mechanism.potential_energy"]
    found[how] = (run.time, {**run, "sum": total})
    print(f"{how}: the energy drifts by {abs(total - total[0]).max():.3f} J")  # 0.293 in the paper
draw("durango_6.png", "time [s]", MOTION, {h: found[h] for h in ("euler_q", "energy")})
draw("durango_7.png", "time [s]", ENERGY, {h: found[h] for h in ("euler_q", "energy")})
