"""Outliers are listed by their rows, stop nothing, and are none where the model only lacks something."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made, with_geometric_errors

from elastocal.data_checks.outliers import find


@pytest.fixture(scope="module", params=["base", "tracker"])
def campaign(request, fanuc):
    return made(fanuc, 1, Plan(poses=20, tracker=request.param == "tracker"))


@pytest.mark.parametrize("size", [0.003, 0.3])
def test_single_measurements_far_away_are_listed_by_their_rows(campaign, size):
    rng, position = np.random.default_rng(0), campaign.measurements.position.copy()
    some = np.sort(rng.choice(len(position), 8, replace=False))
    position[some] += size * np.array([1.0, -1.0, 1.0])
    (fault,) = find(campaign, replace(campaign.measurements, position=position))
    assert (fault.name, fault.joints, fault.decisive) == ("outliers", (), False)
    assert fault.rows == tuple((some + 1).tolist())
    assert fault.parameters[0].value == pytest.approx(8 / len(position))
    assert fault.evidence[1] < fault.evidence[0]


def test_an_orientation_far_away_is_listed(campaign):
    turned = campaign.measurements.rotation_vector.copy()
    turned[17, 0] += 0.05
    (fault,) = find(campaign, replace(campaign.measurements, rotation_vector=turned))
    assert fault.rows == (18,)
    assert "one of" in fault.detail


def test_the_rows_are_those_of_the_file_whatever_part_of_it_is_read(campaign):
    position = campaign.measurements.position.copy()
    position[100] += 0.05
    kept = campaign.measurements.pose % 2 == campaign.measurements.pose[100] % 2
    (fault,) = find(campaign, replace(campaign.measurements, position=position).select(kept))
    assert fault.rows == (101,)


@pytest.mark.parametrize("seed", range(4))
def test_a_model_that_lacks_something_makes_no_outliers(fanuc, seed):
    lacking = made(fanuc, seed, Plan(), with_geometric_errors(fanuc, seed, 0.006), sag=3e-3)
    assert find(lacking, lacking.measurements) == []


def test_measurements_without_noise_have_no_outliers(fanuc):
    exact = made(fanuc, 1, Plan(poses=20, noise=0.0))
    assert find(exact, exact.measurements) == []
