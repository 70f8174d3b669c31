"""The curves of both papers, redrawn: python examples/papers.py [FOLDER]."""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import blockmech as bm

GRAPHS = Path(__file__).parents[1] / "graphs"
FRICTION = {"crank.drive": "N m", "mechanism.friction_power": "W", "dyad.D.reaction": "N"}
MOTION = {"crank.q": "rad", "crank.rate": "rad/s", "crank.A.reaction": "N"}
ENERGY = {"mechanism.kinetic_energy": "J", "mechanism.potential_energy": "J", "sum": "J"}


def draw(path: Path, x: str, units: dict[str, str], curves: dict[str, tuple]) -> None:
    """One panel an output; ``curves``: label -> abscissae and the outputs by name."""
    figure = Figure(figsize=(7, 2.6 * len(units)), layout="constrained")
    for axes, (name, unit) in zip(figure.subplots(len(units)), units.items(), strict=True):
        for (label, (at, found)), style in zip(curves.items(), ("-", "--", ":"), strict=False):
            axes.plot(at, abs(found[name]) if unit == "N" else found[name], style, label=label)
        axes.set(xlabel=x, ylabel=f"{name} [{unit}]")
    axes.legend()
    figure.savefig(path)


folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
ruiz = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").compile()  # Figs. 12 to 14 of 2010
runs = {how: ruiz.run(friction=how, want=FRICTION) for how in ("successive", "single", "none")}
found = {how: (run.drivers["crank.q"], run) for how, run in runs.items()}
draw(folder / "ruiz_12_to_14.png", "crank angle [rad]", FRICTION, found)
watt, want = bm.Graph.load(GRAPHS / "watt_sixbar.json").compile(), [*MOTION, "mechanism.*_energy"]
for how, step in (("euler_q", 1e-3), ("energy", None)):  # Figs. 6 and 7 of 2014
    run = watt.simulate("standstill", method=how, step=step, want=want)
    total = run["mechanism.kinetic_energy"] + run["mechanism.potential_energy"]
    found[how] = (run.time, {**run, "sum": total})
    print(f"{how}: the energy drifts by {abs(total - total[0]).max():.3f} J")  # 0.293 in the paper
draw(folder / "durango_6.png", "time [s]", MOTION, {h: found[h] for h in ("euler_q", "energy")})
draw(folder / "durango_7.png", "time [s]", ENERGY, {h: found[h] for h in ("euler_q", "energy")})
