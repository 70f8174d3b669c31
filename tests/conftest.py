"""Hypothesis profiles: deterministic in CI, fresh examples elsewhere; a failure prints its blob.

What is collected lives as long as the run: the garbage collector need not look at it again and
again, which doubled the time of collecting.
"""

import gc
import os

import pytest
from hypothesis import HealthCheck, settings

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

gc.disable()


def pytest_collection_finish() -> None:
    """Set aside what was collected."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="module")
def one_repeat():
    """Trades time each setting once after its cold run: fewer say the same of its error."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("blockmech.analysis.trade.measure.FEWEST", 1)
        patch.setattr("blockmech.analysis.trade.measure.LONG_ENOUGH", 0.0)
        yield
