"""A press near its dead centre: what friction leaves of the toggle, and where it locks itself."""

import math
from pathlib import Path

import blockmech as bm

FILE = Path(__file__).parents[1] / "graphs" / "motions" / "locking_press.json"
ANGLES = [0.02, 0.05, 0.1, 0.2, 0.5]  # [rad] from the dead centre
LOAD = 10e3  # [N] on the ram

press = bm.Graph.load(FILE).compile()
down = press.run(at=ANGLES, rates=-1.0, static=True, want="crank.drive")["crank.drive"]
free = press.run(at=ANGLES, static=True, friction="none", want="crank.drive")["crank.drive"]
back = press.run(at=ANGLES, rates=1.0, static=True, want="crank.drive")["crank.drive"]

print("angle   load/moment [1/m]   efficiency   let go, the load")
for q, moment, ideal, held in zip(ANGLES, down, free, back, strict=True):
    goes = "drives back" if held < 0 else "stays: it must be pulled open"
    print(f"{math.degrees(q):4.1f}°  {LOAD / abs(moment):16.1f}   {ideal / moment:10.0%}   {goes}")
