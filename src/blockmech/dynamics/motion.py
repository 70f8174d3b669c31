"""How far integrators go; and the records of `blockmech.motion`, which answer a simulation."""

from blockmech.motion import FACT_UNITS as FACT_UNITS
from blockmech.motion import Cost as Cost
from blockmech.motion import Event as Event
from blockmech.motion import Floats as Floats
from blockmech.motion import Impact as Impact
from blockmech.motion import Lying as Lying
from blockmech.motion import Motion as Motion
from blockmech.motion import Slips as Slips
from blockmech.motion import State as State
from blockmech.motion import Status as Status
from blockmech.motion import Still as Still
from blockmech.motion import Track as Track
from blockmech.motion import fact_unit as fact_unit

INTEGRATORS = ("dop853", "lsoda", "radau")  # SciPy's, in time
EVALUATIONS = 500_000  # states, or steps, at most in a run of an integrator; some seconds
