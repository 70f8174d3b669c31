"""Small mechanisms with loads for the tests of steady states: a rod on a pivot, a slide."""

from __future__ import annotations

import math

import pytest

import blockmech as bm
from blockmech.ground.errors import RequestError
from tests.machines import bar, crank, wire

TURN = 2 * math.pi
LONG = 1e-9  # agreement with a long integration, which is no better itself
MULTIPLIER = 1e-9  # of multipliers known in closed form
OBSERVED = 1e-6  # of one that is observed: the square of the disturbance shows
JUDGE = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13}

MASS, LENGTH = 1.0, 1.0
J = MASS * LENGTH**2 / 3  # [kg m2] of the rod about its pivot
WEIGHT = MASS * 9.81 * LENGTH / 2  # [N m] its moment where it lies level
M, K = 2.0, 50.0  # [kg], [N/m] of the slide
LOWEST = -math.pi / 2  # [rad] the rod hanging
ON_ROD = {"a": "frame.A", "b": "crank.crank"}


def bare_rod(gravity=9.81, **markers):
    """A uniform rod on a pivot, and further markers of the frame."""
    return crank(LENGTH, bar(MASS, LENGTH), gravity=gravity, **markers)


def rod(*laws, gravity=9.81):
    """The rod with moments by laws."""
    graph = bare_rod(gravity)
    for i, law in enumerate(laws):
        graph.add(f"load{i}", bm.Motor(law=law))
        for terminal, marker in ON_ROD.items():
            graph.connect(marker, f"load{i}.{terminal}")
    return graph.compile()


def slide(mass=M, stiffness=K, damping=3.0, law=None):
    """A mass on a guide between spring, damper and a force by a law."""
    graph = bm.Graph("slide")
    far = -5.0  # [m] where the spring is held, so that it never passes its own end
    graph.add(
        "frame", bm.Frame(markers={"A": bm.Marker(at=(0.0, 0.0), angle=0.0), "W": (far, 0.0)})
    )
    body = bm.Link(mass=mass, inertia=0.1, cm=(0.0, 0.0), markers={"P": (0.0, 0.0)})
    graph.add("slider", bm.SlideDrive(links={"slider": body}))
    graph.connect("frame.A", "slider.S")
    loads = {"spring": bm.Spring(stiffness=stiffness, free_length=-far, damping=damping)}
    if law is not None:
        loads["force"] = bm.Thrust(law=law)
    for name, load in loads.items():
        graph.add(name, load)
        wire(graph, f"frame.W {name}.a", f"slider.P {name}.b")
    return graph.compile()


def wave(period, *cosines, mean=0.0):
    """A law of the time: a Fourier series."""
    return {
        "kind": "fourier",
        "of": "time",
        "period": period,
        "mean": mean,
        "cosines": list(cosines),
    }


def of_rate(*coefficients):
    """A law of the rate: a polynomial without constant term."""
    return {"kind": "polynomial", "of": "rate", "coefficients": [0.0, *coefficients]}


def motor(stall, idle):
    """The straight line of a direct-current motor."""
    return {"kind": "dc", "stall_moment": stall, "no_load_speed": idle}


def at_rest(q, name="crank"):
    """A start at rest."""
    return {name: (q, 0.0)}


def refused(scene, **request):
    """What is said where there is no steady state."""
    with pytest.raises(RequestError) as caught:
        scene.simulate("steady", **request)
    (problem,) = caught.value.problems
    return str(problem)
