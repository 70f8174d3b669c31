"""The same mechanism rotated in the plane: another way to the same numbers.

Rotating changes every product and sum in the kernels and, in exact arithmetic, no
answer but directions. What two rotated runs differ by is therefore rounding, amplified
as this mechanism amplifies it at these samples.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from typing import Any

import numpy as np

from blockmech.analysis.reference_errors import how
from blockmech.blocks.contract import Moving
from blockmech.blocks.general.block import GeneralGroup
from blockmech.compiled import Compiled
from blockmech.engines.interpreters import NumpyEngine
from blockmech.engines.numpy import Planar
from blockmech.functions.series import GOLDEN
from blockmech.ground.tolerances import ROUNDING
from blockmech.ground.values import Marker, Place, Vector
from blockmech.loads import Force, Thrust
from blockmech.loads.contract import Element
from blockmech.model.structure import JointRef, Structure
from blockmech.result.result import Result
from blockmech.result.samples import Samples
from blockmech.typing import Arguments, Nested

ANGLE = GOLDEN * math.tau  # [rad] no symmetry of anything
E = cmath.rect(1.0, ANGLE)


def rotated_run(
    mechanism: Compiled, samples: Samples, precision: str, settings: Arguments
) -> Result:
    """A run of the rotated mechanism, its vectors and directions rotated back.

    Numbers of the ground are rotated in the precision of the run, so nothing is lost to
    the double precision that graphs are written in.
    """
    other = rotated(mechanism)
    plan = other.plan(**settings)
    plain = mechanism.plan(**settings).program.parameters
    engine = NumpyEngine(plan.program, precision)
    angle = engine.dtype(ANGLE)
    e = Planar(np.cos(angle), np.sin(angle))
    engine.parameters = tuple(
        _in_precision(engine, plain.get(name, 1 + 0j), value, e)  # no slot: along x
        for name, value in plan.program.parameters.items()
    )
    values = engine.run(samples.given(plan.program.inputs), samples.n)
    back = Planar(e.real, -e.imag)
    values = tuple(v * back if isinstance(v, Planar) else v for v in values)
    return Result(other, plan, samples, values, "numpy", how(settings))


def rotated(mechanism: Compiled) -> Compiled:
    """The mechanism rotated about the frame's origin, ground and gravity with it."""
    whole = mechanism.structure
    markers = {
        name: Marker(at=Place(E * m.at.z), dir=Vector(E * m.direction))
        for name, m in getattr(whole.fixed, "markers", {}).items()
    }
    structure = replace(
        whole,
        fixed=whole.fixed.model_copy(update={"markers": markers}),
        blocks={name: _home(block) for name, block in whole.blocks.items()},
        elements={name: _load(whole, name) for name in whole.elements},
    )
    scene = mechanism.scene.model_copy(update={"gravity": _turned(mechanism.scene.gravity)})
    return type(mechanism)(structure, scene, mechanism.name, mechanism.names)


def _turned(vector: Vector) -> Vector:
    return Vector(E * vector.z)


def _load(structure: Structure, name: str) -> Element:
    """A load; what it is given in ground axes is rotated."""
    load = structure.elements[name]
    if isinstance(load, Force) and load.axes == "ground":
        vectors = {key: getattr(load, key) for key in ("force", "direction")}
        return load.model_copy(update={key: _turned(v) for key, v in vectors.items() if v})
    if isinstance(load, Thrust) and load.direction is not None:
        on_ground = structure.holds[JointRef(name, "a")].on == structure.frame_link
        return load.model_copy(update={"direction": _turned(load.direction)} if on_ground else {})
    return load


def _home(block: Moving) -> Moving:
    """A block; the pose that tells the assembly mode of a general group is rotated."""
    if not isinstance(block, GeneralGroup):
        return block
    poses = {}
    for name, (x, y, angle) in block.home.poses.items():
        z = E * complex(x, y)
        poses[name] = (z.real, z.imag, angle + ANGLE)
    return block.model_copy(update={"home": block.home.model_copy(update={"poses": poses})})


def _in_precision(engine: NumpyEngine, plain: Any, rough: Any, e: Planar) -> Any:
    """A parameter of the rotated mechanism, ``rough`` in double, in the engine's precision."""
    if plain == rough:
        return engine._cast(rough)
    if isinstance(rough, tuple):
        parts = [_in_precision(engine, *pair, e) for pair in zip(plain, rough, strict=True)]
        return type(rough)(*parts) if hasattr(rough, "_fields") else tuple(parts)
    exact = engine._cast(plain)
    if isinstance(exact, Planar) and _near(rough, plain * E):
        return exact * e
    # Rotating only rounds what belongs to a link; a home's angles it changes, and they are
    # no more than where the way to an answer starts.
    return exact if _near(rough, plain) else engine._cast(rough)


def _near(a: Nested, b: Nested) -> bool:
    return bool(np.allclose(a, b, rtol=ROUNDING, atol=0.0))
