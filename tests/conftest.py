"""Hypothesis profiles: deterministic in CI, fresh examples elsewhere; a failure prints its blob.

What is collected lives as long as the run: the garbage collector need not look at it again and
again, which doubled the time of collecting.

Each process computes in one thread, and what it starts does so too: the threads of two workers
on two cores wait for one another, and a singular value decomposition takes ten times as long.
"""

import gc
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import HealthCheck, settings

from tests.fresh import without_kept_code
from tests.slow import SLOW

SHARED = {
    "deadline": None,  # machines differ
    "print_blob": True,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large],
}
settings.register_profile("ci", derandomize=True, **SHARED)
settings.register_profile("local", **SHARED)
settings.load_profile(
    os.environ.get("HYPOTHESIS_PROFILE", "ci" if os.environ.get("CI") else "local")
)

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when numpy is first imported

gc.disable()


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Workers of xdist take over what is left of each other's tests: some last a minute."""
    if getattr(config.option, "dist", "") == "no" and config.option.numprocesses:
        config.option.dist = "worksteal"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is slow: ``-m "not slow"`` is every room's core."""
    tests = Path(__file__).parent
    for item in items:
        room = item.path.parent.name if item.path.parent != tests else ""
        modules = SLOW.get(room, "none") if tests in item.path.parents else "none"
        if not modules or item.path.stem.removeprefix("test_") in modules.split():
            item.add_marker(pytest.mark.slow)


def pytest_collection_finish() -> None:
    """Set aside what was collected, the little garbage in it included."""
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def _own_registries():
    """What a test registers is known to that test alone: messages list all that there is.

    Families that are imported when they are asked for are there before, or they were lost with it.
    """
    from blockmech.blocks.block import REGISTRY
    from blockmech.couplings import kinds as couplings  # noqa: F401
    from blockmech.friction.laws.contract import LAWS
    from blockmech.signals import kinds as signals  # noqa: F401

    before = [(registry, dict(registry._types)) for registry in (REGISTRY, LAWS)]
    yield
    for registry, types in before:
        registry._types.clear()
        registry._types.update(types)


@pytest.fixture(scope="module")
def one_repeat():
    """Trades time each setting once after its cold run: fewer say the same of its error."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("blockmech.analysis.trade.measure._is_settled", bool)
        yield


class Said(NamedTuple):
    """What a call answered."""

    code: int
    out: str
    err: str


Call = Callable[..., Said]


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Call:
    """``call("run", file)``: exit code, standard output and standard error of the command."""

    def calling(*arguments: str | os.PathLike[str]) -> Said:
        from blockmech.cli import main

        capsys.readouterr()
        code = main([os.fspath(word) for word in arguments])
        return Said(code, *capsys.readouterr())

    return calling


@pytest.fixture
def fresh() -> Iterator[None]:
    """As in a new process without files: no machine code is there, and nothing was asked before."""
    with without_kept_code():
        yield
