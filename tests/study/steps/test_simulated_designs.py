"""Simulated designs of one robot, under loads that move all joints and one that does not."""

import pandas as pd
import pytest
from made_studies import few_of

from elastocal.study.steps.simulated_designs import simulated_design_blocks

USES = {"centre_m": [1.6, 0.0, 1.0], "edge_m": 1.0, "weight_N": 1000}
LOADS = {"random": None, "hanging": [0, 0, -1]}


@pytest.fixture(scope="module")
def table(kuka):
    return pd.concat([pd.DataFrame(block) for block in simulated_design_blocks(few_of(kuka), 150, [6, 12], LOADS, USES)])


def test_chosen_configurations_leave_less_than_random_ones(table):
    for _, cell in table.groupby(["load", "configurations"]):
        rms = cell.set_index("design").rms
        assert set(rms.index) == {"random", "D", "A", "I", "test pose"}
        assert rms["I"] < rms["random"]


def test_the_test_pose_criterion_is_best_at_its_pose(table):
    by = table[(table.load == "random") & (table.configurations == 12)].set_index("design")
    assert by.there["test pose"] < 1.2 * by.there.drop("test pose").min() and by.rms["I"] < by.rms["test pose"]
