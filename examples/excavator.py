"""What an excavator can dig: the force at its teeth at which the first cylinder gives in."""

from pathlib import Path

import numpy as np

import blockmech as bm
from blockmech.result.result import Result

FILE = Path(__file__).parents[1] / "graphs" / "excavator.json"
PUSH = {"boom": 590e3, "arm": 480e3, "curl": 360e3}  # [N] that the cylinders can push or hold
REACH = {"boom": np.linspace(2.3, 2.8, 6), "arm": 3.3, "curl": 2.4}  # [m] their lengths


def holding(force: tuple[float, float]) -> Result:
    """The arm with a force [N] on its teeth, friction left out, as one that stands still."""
    data = bm.Graph.load(FILE).to_data()
    data["blocks"]["digging"]["force"] = list(force)
    arm = bm.Graph.from_data(data).compile()
    return arm.run(at=REACH, want=["*.drive", "bucket.tip.p"], static=True, friction="none")


empty, loaded = holding((0.0, 0.0)), holding((1e3, 0.0))  # digging away from the driver
print("  teeth at [m]     digs [kN]   limited by")
for k, tip in enumerate(empty["bucket.tip.p"]):
    most = {}
    for cylinder, push in PUSH.items():
        own, each = (run[f"{cylinder}.drive"][k] for run in (empty, loaded))
        most[cylinder] = max((sign * push - own) / (each - own) for sign in (1, -1))  # [kN]
    weakest = min(most, key=most.__getitem__)
    print(f"{tip.real:6.2f} {tip.imag:8.2f}  {most[weakest]:12.1f}   {weakest}")
