"""Simulate: a mechanism moves under its loads, and everything else follows from that.

The system carries the motion of the drivers; the wanted outputs are then computed at the
output times through the same pruned plan as any other run. A request that asks for the
drivers' motion alone computes no acceleration and no reaction, unless joints have friction.

Sources: [D14] Durango et al. 2014, Fig. 1 and section 2.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from blockmech.dynamics import ends
from blockmech.dynamics.chart_outputs import result_along
from blockmech.dynamics.impact import bounced
from blockmech.dynamics.layout import in_numbers
from blockmech.dynamics.loads import refuse_memory
from blockmech.dynamics.methods import move
from blockmech.dynamics.motion_outputs import SimulationResult
from blockmech.dynamics.request import (
    OUTPUTS,
    Pairs,
    SimulationRequest,
    Until,
    Watch,
    refuse_no_inertia,
    request_of,
)
from blockmech.dynamics.roles import RolesGiven, unused_laws
from blockmech.dynamics.stops import prepared
from blockmech.dynamics.system import System
from blockmech.dynamics.undefined import with_undefined_loads
from blockmech.engines.llvm import compiled_program
from blockmech.ground.arguments import declared
from blockmech.ground.errors import listed, refused
from blockmech.ground.progress import with_bar
from blockmech.plan.settings import friction_asked
from blockmech.result.motion import Motion, RolesFrom
from blockmech.typing import (
    EngineName,
    FrictionMethod,
    M,
    MotionMethod,
    Numbers,
    Progress,
    Quantity,
)

if TYPE_CHECKING:
    from blockmech.compiled import Compiled


@with_bar
@declared
@np.errstate(all="ignore")  # what is not finite ends a motion by name
def simulate(
    mechanism: Compiled[M],
    until: str | Until | None = None,
    *,
    method: MotionMethod = "auto",
    accuracy: Quantity | None = None,
    times: Numbers | None = None,
    start: Pairs | None = None,
    stops: Pairs | None = None,
    watch: Sequence[Watch] = (),
    roles: RolesGiven | None = None,
    want: Iterable[str] | str = ("*.q", "*.rate"),
    friction: FrictionMethod | None = None,
    engine: EngineName = "auto",
    budget: Quantity | None = None,
    progress: Progress | None = None,
) -> SimulationResult[M]:
    """Simulate the motion of a mechanism from its start until a condition or event ends it.

    Parameters
    ----------
    until : "standstill" (default), "swings=3", "turns=3", "time=2", "angle=360deg",
        "steady" or "event", or of several whichever is met first, "standstill, time=2"; with
        ``times`` and without ``until`` the last of them.
        ``"steady=<s>"`` names the period of loads that follow the time by a function
    method : "auto", "energy", "dop853", "radau", "rk4" or "euler_q", see `METHODS`; or a
        `FixedStep`
    accuracy : target [rad or m] of the driver coordinate at all times
    times : (n,) output times [s]; by default 201 over the whole run, of many turns or swings at
        least 33 for each, and those of events
    start : driver -> (q [rad or m], rate), or q alone at rest; by default the scene's ``initial``
    stops : driver, or the coordinate of a pair such as ``"rod.S.coordinate"`` -> (lowest,
        highest) [rad or m]; by default the scene's
    watch : the user's events
    roles : driver -> "prescribed" (it follows its law of motion while the others are free),
        "locked" where it starts, or the coordinate [rad or m] at which it is locked; in place of
        the roles that the scene gives in ``motion``
    want : outputs at the output times
    friction : of the joints: "none", "single", "successive" or "newton" (default)
    engine : "scalar", "llvm" (machine code), or "auto": machine code once the mechanism's motions
        are worth compiling. Without machine code path methods work on NumPy's arrays
    budget : processor time [s], by default 60, after which the motion computed so far is returned
    progress : called during the run with (task, amount completed, total amount or None)

    Returns
    -------
    SimulationResult at the output times, with ``motion``: method, engine and why, error estimate,
    events, cost, and what ended the run. Output times after the end are left out. An
    interrupted run (Ctrl-C) is returned as far as it came; its end is "interrupted".

    Raises
    ------
    RequestError for a start that is missing or beyond an end stop, for a mechanism without
    inertia, for a method that does not apply, and for invalid numbers or engines;
    MissingEngineError without llvmlite

    >>> swing = mech.simulate("time=0.2", start={"crank": (0.0, "5 rad/s")}, times=[0.1, 0.2])
    >>> swing["crank.q"].round(4)
    array([0.4155, 0.5439])
    """
    about = until, method, accuracy, times, start, stops, watch, roles, budget, engine
    request, starts = request_of(mechanism.scene, mechanism._coordinate_units, *about)
    report, limit = progress_of(progress), ends.Budget(request.seconds)
    friction_method = friction_asked(friction)
    mechanism._plan_for(want, replace(friction_method, along=friction_method.method != "none"))
    options = {"method": friction_method, "progress": report, "engine": engine, "budget": limit}
    prepare = partial(prepared, options=options)
    system, request = prepare(mechanism, request, starts, stops)
    if request.roles is None:
        mechanism._once(refuse_no_inertia)
    refuse_memory(mechanism, starts)
    if engine == "llvm" and system.engine_of_states.name != engine:
        compiled_program(system.equation_program)  # says why it cannot be
    search = None
    if request.until.goal == "steady":
        from blockmech.dynamics.steady import steady_motion  # few ask for it

        search = steady_motion
    motion = bounced(system, request, move) if request.stops else move(system, request, search)
    if motion.end in ends.CHART_ENDS:
        from blockmech.dynamics.atlas import beyond_dead_centres  # few motions need it

        motion = beyond_dead_centres(motion, system, request, stops, prepare, move)
    if request.roles is not None and len(mechanism.drivers) == 1:
        motion = in_numbers(motion)
    motion = explained(mechanism, system, request, motion)
    count = OUTPUTS if motion.t_end > motion.t_start else 1
    reached = motion.reached_times(motion.curve_times(count) if times is None else request.times)
    inside = reached[~np.isnan(reached)]
    if late := len(reached) - len(inside):
        note = f"{late} of {len(reached)} times after the end are left out"
        motion = replace(motion, notes=(*motion.notes, note))
        inside = inside if len(inside) else np.array([motion.t_end])
    return result_along(mechanism, motion, inside, want, friction or "newton")


def leading_joints(mechanism: Compiled) -> tuple[str, ...]:
    """The joints of the drivers, in the words of outputs."""
    driven = (str(mechanism.structure.driven[driver]) for driver in mechanism.drivers)
    return tuple(mechanism._joint_names.get(x, x).removeprefix("joint.") for x in driven)


def explained(
    mechanism: Compiled, system: System, request: SimulationRequest, motion: Motion
) -> Motion:
    """The motion with what else a reader must know of it."""
    motion = with_undefined_loads(mechanism, motion)
    if not motion.charts:
        motion = motion.but(charts=((motion.t_start, mechanism._once(leading_joints)),))
    if request.roles is not None and not motion.roles:  # it did not begin
        motion = replace(motion, roles=(RolesFrom(motion.t_start, request.roles.by_driver()),))
    units = set(mechanism._coordinate_units.values())
    unit = units.pop() if len(units) == 1 else motion.unit
    # What else a reader must know of how a run ended.
    goal = request.until
    scene, roles = system.compiled.scene, [x.of for x in motion.roles]
    remarks = [note] if (note := unused_laws(scene, system.drivers, roles)) else []
    if motion.end == ends.TOO_MANY and goal.goal not in ("time", "steady"):
        met = f"{goal.goal} was not reached in {motion.t_end - motion.t_start:.6g} s"
        remarks.append(f'{met}, and may never be: until="time=<s>" shows the further motion')
    if goal.forcing and "time" not in system.depends_on:
        remarks.append(f"no load follows the time: the period {goal.forcing:.9g} s is not used")
    if motion.end == ends.SELF_LOCKED and system.friction is not None:
        slopes = enumerate(system.friction.program.steepest)
        if of := [system.pair_name(j) for j, steepest in slopes if steepest]:
            why = f"friction of {listed(of)} is not linear in the load"
            remarks.append(f"{why}: a unique solution may exist but could not be proved")
    return motion.but(unit=unit, notes=(*motion.notes, *remarks))


def evaluation_cost(mechanism: Compiled, friction: FrictionMethod | None) -> str:
    """Kernel calls that one evaluation of the motion takes, as a line of text."""
    system = System(mechanism, method=friction_asked(friction))
    passes = {"equation of motion": (system.equation_program, 1)}
    if system.friction is not None:
        resisting = system.friction.program
        many = 1 + len(system.drivers) + len(resisting.names)  # the loads, each q'', each pair
        passes["pairs with friction"] = (resisting.program, many)
    parts = []
    for program_name, (program, times) in passes.items():
        parts.append(f"{program_name} {program.calls}" + (f", {times} times" if times > 1 else ""))
    return "kernel calls of an evaluation of the motion: " + "; ".join(parts)


def progress_of(progress: object) -> Progress | None:
    """What is called with progress; silent after it raised, as the run goes on."""
    if progress is None:
        return None
    if not callable(progress):
        raise refused(
            "progress", f"{progress!r} cannot be called", "give a function, or leave it out"
        )
    raised = False

    def report(activity: str, position: float, total: float | None) -> None:
        nonlocal raised
        if not raised:
            try:
                progress(activity, position, total)
            except KeyboardInterrupt:
                raised = True
                raise

    return report
