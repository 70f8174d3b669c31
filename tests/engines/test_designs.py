"""A program runs designs of one structure: its parameters are formulas of their numbers."""

from dataclasses import replace

import numpy as np
import pytest

from blockmech.engines.interpreters import NumpyEngine
from blockmech.engines.llvm import compiled_program
from blockmech.friction import solvers
from blockmech.ground.plane import apply
from blockmech.ground.values import Marker, Place
from blockmech.result.samples import make_samples
from tests import gallery

L, M, X, F = (5.5, 6.0, 6.5), (0.3, 2.0, 0.0), (5.0, 5.5, 5.25), (0.0, 0.1, 120.0)
# Beyond the certificate; the mass alone varies, so influences are those of all designs.
ROUGH = ((6.0,) * 3, (0.3, 2.0, 50.0), (5.5,) * 3, (450.0,) * 3)


def design(mechanism, l_i, mass, x, coefficient):
    """Structure of the paper's four-bar with other numbers, unchecked: of any type."""
    s = mechanism.structure
    dyad, D = s.blocks["dyad"], s.fixed.markers["D"]
    link = dyad.links["i"].model_copy(update={"mass": mass})
    law = dyad.friction["C"].model_copy(update={"coefficient": coefficient})
    changes = {
        "l_i": l_i,
        "links": {**dyad.links, "i": link},
        "friction": {**dyad.friction, "C": law},
    }
    at = Place(apply("planar", x, D.at.z.imag))
    markers = {**s.fixed.markers, "D": Marker.model_construct(at=at, angle=None, dir=None)}
    return replace(
        s,
        blocks={**s.blocks, "dyad": dyad.model_copy(update=changes)},
        fixed=s.fixed.model_copy(update={"markers": markers}),
    )


@pytest.mark.parametrize("engine", ["numpy", "llvm"])
@pytest.mark.parametrize(
    ("friction", "numbers"),
    [("none", (L, M, X, F)), ("newton", (L, M, X, F)), *((f, ROUGH) for f in solvers.SOLVERS)],
)
def test_designs_of_one_program_equal_their_own_compile_to_the_last_bit(friction, numbers, engine):
    if engine == "llvm":
        pytest.importorskip("llvmlite", reason="the compiled engine needs the extra fast")
    plain = gallery.mechanism("ruiz_fourbar")
    q = np.linspace(0.0, 6.0, 7)
    want = ["dyad.C.reaction", "crank.drive", "dyad.i.alpha", "crank.q"]
    plan = plain.plan(want, friction=friction)
    columns = [np.array(x)[:, None] if len(set(x)) > 1 else x[0] for x in numbers]
    values = plan.program.values(design(plain, *columns), plain.scene)
    samples = make_samples({"crank": "rad"}, plain.scene, q, rates=10.0)
    inputs = samples.given(plan.program.inputs)
    kind = NumpyEngine if engine == "numpy" else compiled_program
    program = kind(plan.program)
    result = program.run_designs(inputs, program.numbers(values))
    for k, own_numbers in enumerate(zip(*numbers, strict=True)):
        alone = type(plain)(design(plain, *own_numbers), plain.scene)
        program = alone.plan(want, friction=friction)
        single, _ = alone._evaluate(program, samples, engine)
        for name in want:
            together, expected = result[plan.layout[name][0]], single[program.layout[name][0]]
            np.testing.assert_array_equal(np.broadcast_to(together.real, (3, 7))[k], expected.real)
            np.testing.assert_array_equal(np.broadcast_to(together.imag, (3, 7))[k], expected.imag)
