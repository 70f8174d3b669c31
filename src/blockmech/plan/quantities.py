"""What can be wanted, in words: the last part of an output's name -> what it is.

Signs and references are said here once; the command line and the documentation read them.
"""

from __future__ import annotations

from collections.abc import Mapping

QUANTITIES: Mapping[str, str] = {
    # drivers
    "q": "coordinate of the driver",
    "rate": "rate of the driver",
    "acceleration": "acceleration of the driver",
    "drive": "driving moment or force of {by} on {on}, friction included",
    "drive_by_reduction": "the same by the reduction pass, without friction in joints",
    "J_red": "inertia of the whole mechanism, reduced to the driver",
    "tau_red": "all loads and weights, reduced to the driver",
    "dJ_red": "slope of the reduced inertia by the coordinate",
    # links and points, in the axes of the frame
    "angle": "angle of the link's own axes, between -pi and pi",
    "omega": "angular velocity, counter-clockwise",
    "alpha": "angular acceleration, counter-clockwise",
    "p": "place of the point",
    "v": "velocity of the point",
    "a": "acceleration of the point",
    "play": "how far clearance in pins displaces the point, journals lying as reactions press",
    "play_bound": "the most that play can be along x and along y, however reactions point",
    # pairs
    "reaction": "force of {by} on {on}; of a slider that across its guide",
    "N": "normal force of {by} on {on}, along the guide's direction turned by +90 degrees",
    "C": "couple of {by} on {on}, about the slider's point",
    "wrench_F": "whole force of {by} on {on}, friction and drive included",
    "wrench_M": "whole moment of {by} on {on}, about the wired point",
    "friction": "friction of {by} on {on}: couple of a pin, force along a guide",
    "coordinate": "angle of {on} against {by}, between -pi and pi unless driven; of a slider"
    " its position along the guide",
    "slip": "rate of the link that friction acts on against the other one",
    "friction_power": "power lost to friction",
    "deflection": "state of the friction law: how far the bristles bend, as slip counts",
    "stored_power": "part of friction_power that bends bristles and may come back",
    # groups
    "margin": "how far from a dead centre: 1 at the best, 0 there",
    "transmission_angle": "transmission angle of the dyad, between 0 and pi/2",
    "existence": "below 1 the friction of the group has a solution for every load",
    # loads
    "force": "force of {by} on {on}",
    "couple": "couple of {by} on {on}",
    "length": "length of the line, of a load with a direction the way along it, maybe negative",
    "tension": "force that pulls its ends together, negative where it pushes them apart",
    "power": "power given to the links",
    # couplings
    "slope": "rate of the driven coordinate by the one that leads",
    "loss": "power that a mesh or belt takes, 0 without friction",
    "effort": "moment or force of {by} on {on} along its coordinate, friction included",
    "moment": "moment of {by} on {on}, about the marker of the driven pair",
    "pressure_angle": "angle between a cam's push and the follower's motion, ccw positive",
    "curvature_radius": "radius of curvature of a cam's profile, negative where it is hollow",
    "contact": "normal force of {by} on {on}; below zero the parts would lift off",
    "slack": "tension of a belt's slack side; below zero it would hang loose",
    # the mechanism
    "kinetic_energy": "kinetic energy of all links",
    "potential_energy": "energy of weights, from the frame's origin, and of springs",
    "drive_power": "power of all drives",
    "useful_power": "power that useful loads take",
    "shaking_force": "force of the mechanism on the frame",
    "shaking_moment": "moment of the mechanism on the frame, about its origin",
    "mechanical_advantage": "useful load over driving effort",
    "efficiency": "work of useful loads over work of the drives, of the run",
    "friction_efficiency": "share of the drives' work that friction leaves, of the run",
    "M": "inertia matrix of the drivers",
    "Q": "loads and weights reduced to the drivers",
}
