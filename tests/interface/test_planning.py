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
    first, *others = str(overview).splitlines()
    assert first.startswith("campaign can be diagnosed: ")
    assert len(others) == len(overview.attention)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda robot: ec.plan("arm.urdf"), "plan: robot"),
        (lambda robot: ec.plan(robot, poses=20.5), "plan: poses"),
        (lambda robot: ec.plan(robot, held_out=-1), "plan: held_out"),
        (lambda robot: ec.simulate(None), "simulate: robot"),
        (lambda robot: ec.simulate(robot, poses=0), "simulate: poses"),
        (lambda robot: ec.simulate(robot, noise_m=-1e-5), "simulate: noise_m"),
        (lambda robot: ec.check("campaigns/cell"), "check: campaign"),
        (lambda robot: ec.diagnose("campaigns/cell"), "diagnose: campaign"),
    ],
)
def test_a_wrong_argument_is_refused_by_its_name(nominal, call, message):
    with pytest.raises(ec.InputError) as caught:
        call(nominal)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)
