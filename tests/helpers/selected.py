"""Cases of which a few are tried at each run of the tests and the others with `make
test-slow`."""

import pytest


def slow_but(fast, cases):
    """Parameters in their order; those that are not `fast` are slow."""
    assert {*fast} <= {*cases}
    return [
        case if case in fast else pytest.param(case, marks=pytest.mark.slow)
        for case in cases
    ]
