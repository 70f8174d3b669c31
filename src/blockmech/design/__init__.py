"""Design of a mechanism: balancing, motors, flywheels, identification, shapes.

`shapes` are mass properties of bars, plates, discs and outlines.

>>> import blockmech as bm
>>> engine = bm.read("graphs/engine.json").compile()
>>> round(bm.design.flywheel(engine, speed=100.0, fluctuation=0.02).inertia, 3)
1.877
"""

from blockmech.design import shapes
from blockmech.design.balance import balance
from blockmech.design.drives import available, motor
from blockmech.design.floquet import floquet
from blockmech.design.flywheel import flywheel
from blockmech.design.identify import identify

__all__ = ["available", "balance", "floquet", "flywheel", "identify", "motor", "shapes"]
__dir__ = __all__.copy  # completion shows these alone
