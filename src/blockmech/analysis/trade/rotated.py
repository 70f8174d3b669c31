"""The same mechanism rotated in the plane: another way to the same numbers.

Rotating changes every product and sum in the kernels and, in exact arithmetic, no
answer but directions. What two rotated runs differ by is therefore rounding, amplified
as this mechanism amplifies it at these samples.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from blockmech.blocks.contract import Block
from blockmech.blocks.frame import Frame
from blockmech.blocks.general.block import GeneralGroup
from blockmech.compiled import Compiled
from blockmech.engines.numpy import NumpyEngine, Planar
from blockmech.loads import Force, Thrust
from blockmech.model.diagram import Wire
from blockmech.model.graph import Graph
from blockmech.model.structure import JointRef
from blockmech.result import Result
from blockmech.values import Marker, Place, Vector

if TYPE_CHECKING:
    from blockmech.samples import Samples

ANGLE = 0.7  # [rad] no symmetry of anything
SAME = 1e-12  # relative difference of numbers that rotating only rounds


class RotatedRun(Mapping[str, Any]):
    """A run of a rotated mechanism, read as if it had not been rotated."""

    def __init__(self, run: Result, angle: Any) -> None:
        self.run, self.quality = run, run.quality
        self.back = np.cos(angle) - 1j * np.sin(angle)
        self.angle = angle

    def __getitem__(self, name: str) -> Any:
        values = np.atleast_1d(np.asarray(self.run[name]))
        if self.run.output(name).kind == "vector":
            return values * self.back
        return values - self.angle if name.endswith(".angle") else values

    def __iter__(self) -> Iterator[str]:
        return iter(self.run)

    def __len__(self) -> int:
        return len(self.run)

    def output(self, name: str) -> Any:
        """Declaration of an output."""
        return self.run.output(name)


def rotated_run(
    mechanism: Compiled, samples: Samples, precision: str, settings: Mapping[str, Any]
) -> RotatedRun:
    """A run of the rotated mechanism.

    Numbers of the ground are rotated in the precision of the run, so nothing is lost to
    the double precision that graphs are written in.
    """
    other = rotated(mechanism)
    want = settings["want"]
    how = {k: v for k, v in settings.items() if k != "want"}
    plan, plain = other.plan(want, **how), mechanism.plan(want, **how)
    engine = NumpyEngine(plan.program, precision)
    real = engine.dtype
    e = Planar(np.cos(real(ANGLE)), np.sin(real(ANGLE)))
    numbers = plain.program.parameters
    engine.parameters = tuple(
        engine._cast(value) if name in numbers and numbers[name] == value
        else _rotated_number(engine, numbers.get(name, 1 + 0j), value, e)
        for name, value in plan.program.parameters.items()
    )  # fmt: skip
    given = samples.given(plan.program.inputs)
    values = engine.run(given, samples.n)
    full = {"friction": "newton", "tolerance": None, "iterations": None, "static": False}
    return RotatedRun(Result(other, plan, samples, values, "numpy", full | how), real(ANGLE))


def rotated(mechanism: Compiled, angle: float = ANGLE) -> Compiled:
    """The mechanism rotated about the frame's origin, ground and gravity with it."""
    structure = mechanism.structure
    e = complex(math.cos(angle), math.sin(angle))
    graph = Graph(mechanism.name)
    scene = mechanism.scene
    gravity = Vector(e * scene.gravity.z)
    graph.scene = scene.model_copy(update={"gravity": gravity})
    graph.blocks = {structure.frame: _rotated_frame(structure.fixed, e)}
    graph.blocks |= {n: _rotated_home(block, e, angle) for n, block in structure.blocks.items()}
    for name, element in structure.elements.items():
        seen: Any = element
        if isinstance(element, Force) and element.axes == "ground":
            seen = element.model_copy(update={"force": Vector(e * element.force.z)})
        elif (
            isinstance(element, Thrust)
            and element.direction is not None
            and structure.holds[JointRef(name, "a")].on == structure.frame_link
        ):
            seen = element.model_copy(update={"direction": Vector(e * element.direction.z)})
        graph.blocks[name] = seen
    ends = {**structure.feeds, **structure.holds}
    graph.wires = [Wire(str(marker), str(joint)) for joint, marker in ends.items()]
    compiled = Compiled.of(graph)
    return Compiled(compiled.structure, compiled.scene, compiled.name, mechanism.names)


def _rotated_frame(frame: Any, e: complex) -> Frame:
    markers = {
        n: Marker(at=Place(e * m.at.z), dir=Vector(e * m.direction))
        for n, m in frame.markers.items()
    }
    found: Frame = frame.model_copy(update={"markers": markers})
    return found


def _rotated_home(block: Block, e: complex, angle: float) -> Block:
    """A block whose assembly mode is told by a pose gets that pose rotated."""
    if not isinstance(block, GeneralGroup):
        return block
    poses = {}
    for name, (x, y, turn) in block.home.poses.items():
        z = e * complex(x, y)
        poses[name] = (z.real, z.imag, turn + angle)
    home = block.home.model_copy(update={"poses": poses})
    return block.model_copy(update={"home": home})


def _rotated_number(engine: NumpyEngine, plain: Any, rough: Any, e: Planar) -> Any:
    """A parameter of the ground, rotated in the engine's precision."""
    if isinstance(rough, tuple):
        parts = [_rotated_number(engine, p, r, e) for p, r in zip(plain, rough, strict=True)]
        return type(rough)(*parts) if hasattr(rough, "_fields") else tuple(parts)
    exact = engine._cast(plain)
    if isinstance(exact, Planar) and _near(rough, plain * _direction()):
        return exact * e
    # Rotating only rounds what belongs to a link; a home's angles it changes, and they are
    # no more than where the way to an answer starts.
    return exact if _near(rough, plain) else engine._cast(rough)


def _near(a: Any, b: Any) -> bool:
    return bool(np.allclose(a, b, rtol=SAME, atol=0.0))


def _direction() -> complex:
    return complex(math.cos(ANGLE), math.sin(ANGLE))
