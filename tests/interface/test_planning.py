from dataclasses import replace

import numpy as np
import pytest

import elastocal as ec


@pytest.fixture(scope="module")
def planned(nominal):
    return ec.plan(nominal, poses=20, held_out=6, seed=4)


def test_plan_has_the_configurations_that_were_asked_for(planned, nominal):
    assert planned.joint_angles.shape == (20, nominal.joints)
    assert planned.held_out_angles.shape == (6, nominal.joints)


def test_more_poses_predict_a_smaller_error(planned, nominal):
    more = ec.plan(nominal, poses=40, held_out=6, seed=4)
    assert more.predicted_error_m < planned.predicted_error_m


def test_simulated_positions_scatter_by_the_noise(nominal):
    rigid = replace(nominal, compliance=np.zeros(nominal.joints))
    table = ec.simulate(rigid, poses=5, repeats=200, noise_m=1e-4, seed=2)
    spread = table.groupby("pose")[[*"xyz"]].std()
    # 15 standard deviations of 200 values each; theirs is 5 %.
    np.testing.assert_allclose(spread, 1e-4, rtol=0.25)


def test_check_says_what_can_be_tested(campaign):
    overview = ec.check(campaign)
    assert overview.diagnosable
    assert overview.testable > 10
