"""Derivatives, batches, compiling and motions by JAX, beside our own."""

import numpy as np
import pytest

import blockmech as bm
from tests.gallery import GRAPHS, changed, document, mechanism
from tests.machines import crank, load

jax = pytest.importorskip("jax", reason="functions of JAX need the extra jax")
jnp = jax.numpy
jax.config.update("jax_enable_x64", True)

CLOSE = 1e-12  # of the largest derivative of the output, each by its number's size


def parts(y):
    """Vectors as pairs of real numbers, of which JAX gives derivatives."""
    return jnp.stack([y.real, y.imag]) if jnp.iscomplexobj(y) else y


def of_result(y):
    return np.stack([y.real, y.imag]) if np.iscomplexobj(y) else y


CASES = {  # graph -> outputs, friction, numbers, modes
    "ruiz_fourbar": (["crank.drive"], "newton", "*", [jax.jacfwd, jax.jacrev]),
    "slider_crank": (["crank.drive", "*.alpha", "*.a"], "single", "*", [jax.jacfwd, jax.jacrev]),
    "engine": (["crank.drive"], "none", "*", [jax.jacrev]),
    "stephenson_3_triad": (["crank.drive"], "none", "triad.*", [jax.jacrev]),
    "joints/watt_sixbar": (["driver.*.drive"], "none", "*", [jax.jacfwd]),
}


@pytest.mark.parametrize(
    ("name", "jacobian"), [(name, mode) for name, case in CASES.items() for mode in case[-1]]
)
def test_both_modes_give_the_derivatives_of_sensitivity(name, jacobian):
    outputs, friction, numbers, _ = CASES[name]
    joints = name.startswith("joints")
    load = bm.Linkage.load if joints else bm.Graph.load
    mech = load(GRAPHS / f"{name}.json").compile()
    driver = mech.drivers[0]
    q, address = np.array([0.3, 1.1, 4.0]), mech._of_driver(driver, "q")
    f = mech.function([address], outputs, numbers, friction=friction)
    ours = mech.sensitivity(outputs, list(f.parameters), q, friction=friction)

    def values(p):
        y = f(p, {address: q})
        return {name: parts(y[name]) for name in f.outputs}

    with jax.disable_jit():
        theirs = jacobian(values)(f.parameters)
    assert len(f.parameters) >= 5
    for output in ours:
        sizes = {a: abs(x) or 1.0 for a, x in f.parameters.items()}
        largest = max(np.abs(ours[output, a]).max() * size for a, size in sizes.items())
        for a, size in sizes.items():
            off = np.abs(of_result(ours[output, a]) - theirs[output][a]).max()
            assert off * size <= CLOSE * largest, (output, a)


def test_a_compiled_gradient_leaves_out_samples_without_an_answer():
    mech = bm.Graph.load(GRAPHS / "ruiz_fourbar.json").replace({"dyad.l_i": 4.0}).compile()
    q = np.linspace(0.0, 6.0, 25)
    f = mech.function(["crank.q"], ["crank.drive"], ["dyad.l_i", "frame.D.x"], friction="none")

    def mean(p):
        return jnp.nanmean(f(p, {"crank.q": q})["crank.drive"] ** 2)

    value, slope = jax.jit(jax.value_and_grad(mean))(f.parameters)
    run = mech.run(q, want="crank.drive", friction="none", on_gap="mark")
    drive = run["crank.drive"]
    ours = mech.sensitivity("crank.drive", list(f.parameters), q, friction="none", on_gap="mark")
    assert np.isnan(drive).any()
    assert float(value) == pytest.approx(np.nanmean(drive**2), rel=1e-12)
    for address, x in slope.items():
        mean_slope = np.nanmean(2.0 * drive * ours["crank.drive", address])
        assert float(x) == pytest.approx(mean_slope, rel=1e-10)


def test_second_derivatives_are_those_of_first_ones_beside_friction_included():
    mech, lengths = mechanism("ruiz_fourbar"), ["dyad.l_i", "dyad.l_j"]
    f = mech.function(["crank.q"], ["crank.drive"], lengths)
    with jax.disable_jit():
        bent = jax.hessian(lambda p: f(p, {"crank.q": 0.9})["crank.drive"])(f.parameters)
    step = 1e-3
    for address, x in f.parameters.items():
        neighbours = [
            mech.document.replace({address: x + k * step}).compile() for k in (-2, -1, 1, 2)
        ]
        slopes = [
            design.sensitivity("crank.drive", lengths, 0.9)["crank.drive"] for design in neighbours
        ]
        a, b, c, d = slopes
        difference = ((a - d) + 8.0 * (c - b))[:, 0] / (12.0 * step)
        ours = [float(bent[address][second]) for second in lengths]
        np.testing.assert_allclose(ours, difference, rtol=1e-8)


def test_designs_and_batches_need_no_new_trace():
    mech = mechanism("slider_crank")
    length = "crank.length"
    f = mech.function(["crank.q"], ["crank.drive"], [length], friction="none")
    traces = []

    @jax.jit
    def drive(p, q):
        traces.append(1)
        return f(p, {"crank.q": q})["crank.drive"]

    q = np.linspace(0.2, 0.5, 4)
    lengths = f.parameters[length] * np.array([1.0, 1.001, 0.999])
    one_by_one = [drive({length: x}, q) for x in lengths]
    assert len(traces) == 1
    together = jax.vmap(lambda x: drive({length: x}, q))(lengths)
    np.testing.assert_allclose(together, one_by_one, rtol=1e-12)
    for x, row in zip(lengths, one_by_one, strict=True):
        alone = mech.document.replace({length: float(x)}).compile()
        ours = alone.run(q, want="crank.drive", friction="none")["crank.drive"]
        np.testing.assert_allclose(row, ours, rtol=1e-11)


def test_friction_compiles_with_its_loops():
    data = document("ruiz_fourbar")
    data["blocks"]["dyad"]["friction"].pop("C")
    mech = changed(data)
    f = mech.function(["crank.q"], ["crank.drive"], ["dyad.l_i"])
    q = np.linspace(0.0, 6.0, 13)
    y = jax.jit(lambda p: f(p, {"crank.q": q}))(f.parameters)
    ours = mech.run(q, want="crank.drive")["crank.drive"]
    np.testing.assert_allclose(y["crank.drive"], ours, rtol=0.0, atol=1e-12 * np.abs(ours).max())
    assert y["ok"].all()


def test_single_precision_is_single_throughout():
    mech = mechanism("ruiz_fourbar")
    f = mech.function(["crank.q"], ["*"], ["dyad.l_i"], precision="complex64")
    with jax.disable_jit():
        y = f(f.parameters, {"crank.q": np.array([0.3, 0.9])})
    ours = mech.run([0.3, 0.9], want="crank.drive")["crank.drive"]
    assert {x.dtype.name for x in y.values()} == {"float32", "complex64", "bool"}
    np.testing.assert_allclose(y["crank.drive"], ours, rtol=2e-6)


def test_groups_without_closed_form_are_followed_in_batches_and_in_designs_near_by():
    mech = mechanism("stephenson_3_triad")
    f = mech.function(["crank.q"], ["triad.*.p"], ["crank.length"], friction="none")
    q = np.array([0.3, 1.1, 4.0])
    for scale in (1.0, 1.002):
        p = {"crank.length": scale * f.parameters["crank.length"]}
        with jax.disable_jit():
            ours = jax.vmap(lambda x, p=p: f(p, {"crank.q": x}))(q)
        alone = mech.document.replace(p).compile().run(q, want="triad.*.p")
        for name in alone:
            np.testing.assert_allclose(ours[name], alone[name], rtol=1e-12)


def test_a_users_function_is_asked_and_has_no_derivative_by_what_it_reads():
    graph = crank(0.5, bm.Link(mass=1.0, inertia=0.1))
    motor = bm.Motor(law=lambda coordinate: 3.0 + coordinate)
    mech = load(graph, "motor", motor, a="frame.A", b="crank.A").compile()
    f = mech.function(["crank.q"], ["crank.drive"], ["crank.links.crank.inertia"], friction="none")
    ours = mech.run([0.3, 0.9], want="crank.drive", friction="none")["crank.drive"]

    def drive(q, p):
        return f(p, {"crank.q": q})["crank.drive"].sum()

    with jax.disable_jit():
        theirs = f({}, {"crank.q": np.array([0.3, 0.9])})["crank.drive"]
        np.testing.assert_allclose(theirs, ours, rtol=1e-13)
        jax.grad(drive, 1)(0.3, f.parameters)  # by the inertia it has one
        with pytest.raises(bm.RequestError, match="no known derivative"):
            jax.grad(drive)(0.3, f.parameters)


def test_a_group_that_no_driver_moves_is_where_its_home_is():
    pairs = {
        "B": {"type": "R", "link": "a"},
        "C": {"type": "R", "links": ["a", "b"], "at": [[1.0, 0.0], [1.0, 0.0]]},
        "D": {"type": "R", "link": "b"},
    }
    poses = {"a": [2.0, 0.0, 0.6], "b": [3.6, 0.0, 2.5]}
    graph = crank(0.5, bm.Link(mass=1.0, inertia=0.1), B=(2.0, 0.0), D=(3.6, 0.0))
    graph.add(
        "truss", bm.GeneralGroup(links={"a": {}, "b": {}}, pairs=pairs, home={"poses": poses})
    )
    graph.connect("frame.B", "truss.B")
    graph.connect("frame.D", "truss.D")
    mech = graph.compile()
    f = mech.function(["crank.q"], ["truss.a.angle"], ["truss.pairs.C.at[0].x"], friction="none")
    ours = mech.run([0.3, 0.9], want="truss.a.angle")["truss.a.angle"]
    theirs = jax.jit(lambda p: f(p, {"crank.q": np.array([0.3, 0.9])}))(f.parameters)
    np.testing.assert_allclose(theirs["truss.a.angle"], ours, rtol=1e-13)
