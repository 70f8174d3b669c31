"""Tools for tests: graph files that are tests, readable assertions, random mechanisms."""

from blockmech.testing.assertions import assert_graph
from blockmech.testing.conformance import ConformanceError, conformance
from blockmech.testing.expectations import Outcome, check_expectations

__all__ = [
    "ConformanceError",
    "Outcome",
    "assert_graph",
    "check_expectations",
    "conformance",
]
