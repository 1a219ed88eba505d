"""Rows are named where other rows' measurements belong to them, beyond what chance can do."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import POINTS, Plan, made, with_other_compliances

from elastocal.data_checks.protocol import faults
from elastocal.data_checks.shuffled_rows import find


@pytest.fixture(scope="module", params=["base", "tracker"])
def campaign(request, fanuc):
    return made(fanuc, 1, Plan(tracker=request.param == "tracker"), with_other_compliances(fanuc, 1, 0.3))


def with_measured(measurements, source):
    return replace(measurements, position=measurements.position[source], rotation_vector=measurements.rotation_vector[source])


def permuted(measurements, share, seed=0):
    rng, source = np.random.default_rng(seed), np.arange(len(measurements))
    some = rng.choice(len(source), max(round(share * len(source)), 2), replace=False)
    source[some] = rng.permutation(some) if share else some[::-1]
    return with_measured(measurements, source), some[source[some] != some]


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_measurements_in_the_rows_of_each_other_are_named_with_these_rows(campaign, share):
    measurements, moved = permuted(campaign.measurements, share)
    (fault,) = find(campaign, measurements)
    assert (fault.name, fault.joints, fault.decisive) == ("shuffled_rows", (), True)
    assert set(fault.rows) <= set((moved + 1).tolist())
    assert len(fault.rows) >= 0.9 * len(moved)
    assert fault.evidence[1] < fault.evidence[0] / 5


def test_poses_whose_measurements_are_swapped_are_named(campaign):
    of_pose = 4 * len(POINTS)
    source = np.arange(len(campaign.measurements)).reshape(-1, of_pose)
    source[[3, 9]] = source[[9, 3]]
    (fault,) = find(campaign, with_measured(campaign.measurements, source.ravel()))
    assert len(fault.rows) == 2 * of_pose


@pytest.mark.parametrize(("steps", "words"), [(1, "row further up"), (-1, "row further down")])
def test_measured_columns_moved_by_one_row_are_named(campaign, steps, words):
    source = np.roll(np.arange(len(campaign.measurements)), steps)
    (fault,) = faults(campaign, with_measured(campaign.measurements, source))
    assert words in fault.detail
    assert fault.parameters[0].value == -steps


def test_measurements_that_belong_nowhere_are_not_shuffled(campaign):
    rng, position = np.random.default_rng(3), campaign.measurements.position.copy()
    some = rng.choice(len(position), 20, replace=False)
    position[some] += rng.normal(0.0, 0.3, (20, 3))
    assert find(campaign, replace(campaign.measurements, position=position)) == []
