"""Selection of the cases that run with every test run; the others run with `make
test-slow`."""

import pytest


def slow_but(fast, cases):
    """Return the cases in their order, and mark those as slow that are not `fast`."""
    assert {*fast} <= {*cases}
    return [
        case if case in fast else pytest.param(case, marks=pytest.mark.slow)
        for case in cases
    ]
