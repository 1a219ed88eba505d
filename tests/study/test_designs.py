"""Designs against each other and against their bound."""

import numpy as np
import pandas as pd
import pytest
from made_studies import few_of

from elastocal.study.designs import CONTINUOUS, RANDOM, rate_designs, simulated_design_blocks


@pytest.fixture(scope="module")
def found():
    rng = np.random.default_rng(1)
    rows = 30 * rng.standard_normal((300, 6, 4)) * np.array([1.0, 2.0, 0.5, 1.0])
    return rate_designs(rows, 1e-3 * rng.standard_normal((50, 3, 4)), [3, 8], np.random.default_rng(2))


def worth(found, kind, size):
    """RMS error of designs of a kind, with 5 and 95 % of random ones."""
    (one,) = [each[2:] for each in found if each[:2] == (kind, size)]
    return one


@pytest.mark.parametrize("size", [3, 8])
def test_designs_lie_between_the_bound_and_random_ones(found, size):
    random, least = worth(found, RANDOM, size), worth(found, CONTINUOUS, size)
    for kind in ("D", "A", "I"):
        assert least[0] <= worth(found, kind, size)[0] < random[0]
    # What is optimised is best, as far as an exchange finds it.
    assert worth(found, "I", size)[0] <= 1.001 * min(worth(found, "D", size)[0], worth(found, "A", size)[0])
    assert random[1] < random[0] < random[2]


LOADS = {"random": None, "hanging": [0, 0, -1]}


def test_chosen_configurations_leave_less_than_random_ones_and_a_hanging_weight_does_not_move_joint_1(kuka):
    table = pd.concat([pd.DataFrame(block) for block in simulated_design_blocks(few_of(kuka), 150, [6, 12], LOADS)])
    for (load, _), cell in table.groupby(["load", "configurations"]):
        rms = cell.set_index("design").rms
        assert set(rms.index) == {"random", "D", "A", "I"} and set(cell.unobservable) == {"1" if load == "hanging" else ""}
        assert rms["I"] < rms["random"]
