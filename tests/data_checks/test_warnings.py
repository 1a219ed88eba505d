"""Compliances that no robot has are named, and positions that a controller worked out are told from measured ones."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import Plan, made

from elastocal.data_checks.warnings import MOST_OFF_NOMINAL, MOST_OFF_USUAL, compliance_warnings, controller_warnings
from elastocal.mechanics.kinematics import poses


def worked_out(robot, tracker, decimals_deg, decimals_mm):
    """A campaign whose positions are those of the robot's own kinematics, angles and positions rounded as they are shown."""
    campaign = made(robot, 1, Plan(poses=14, loads=0, tracker=tracker, oriented=False, noise=0.0))
    measurements, place = campaign.measurements, 0.0
    if not tracker:
        place = np.empty_like(measurements.position)
        for number, target in enumerate(campaign.targets):
            mine = measurements.target == number
            place[mine] = poses(robot.chain, measurements.joint_angles[mine], robot.chain.point(target.point))[0]
    else:
        place = measurements.position
    angles = np.radians(np.degrees(measurements.joint_angles).round(decimals_deg))
    return replace(
        campaign, measurements=replace(measurements, joint_angles=angles, position=(1e3 * place).round(decimals_mm) / 1e3)
    )


@pytest.mark.parametrize("tracker", [True, False])
@pytest.mark.parametrize(("decimals_deg", "decimals_mm"), [(12, 12), (4, 3), (3, 2)])
def test_positions_of_the_files_own_kinematics_are_said_to_be_no_measurements(fanuc, tracker, decimals_deg, decimals_mm):
    (sentence,) = controller_warnings(worked_out(fanuc, tracker, decimals_deg, decimals_mm))
    assert "no measurements" in sentence and "own kinematics" in sentence


@pytest.mark.parametrize("noise", [3e-6, 1e-5, 6e-5])
def test_measured_positions_are_measured(fanuc, noise):
    campaign = worked_out(fanuc, True, 12, 12)
    position = campaign.measurements.position + noise * np.random.default_rng(1).standard_normal((56, 3))
    assert controller_warnings(replace(campaign, measurements=replace(campaign.measurements, position=position))) == []


def test_one_row_that_was_measured_is_enough(fanuc):
    campaign = worked_out(fanuc, False, 4, 3)
    position = campaign.measurements.position.copy()
    position[7, 2] += 2e-4
    assert controller_warnings(replace(campaign, measurements=replace(campaign.measurements, position=position))) == []


NOMINAL = 1e-6 * np.array([0.5, 1.0, 2.0])
ERROR = 0.02 * NOMINAL


@pytest.mark.parametrize("factor", [1 / (0.99 * MOST_OFF_NOMINAL), 0.5, 1.0, 2.0, 0.99 * MOST_OFF_NOMINAL])
def test_what_robots_have_is_no_warning(factor):
    assert compliance_warnings(factor * NOMINAL, ERROR, NOMINAL) == []


@pytest.mark.parametrize(
    ("factor", "words"),
    [(-1.0, "negative, nominal 1"), (9.8, "9.8 times nominal"), (1000.0, "1e+03 times"), (0.1, "0.1 times")],
)
def test_what_no_robot_has_is_named_with_its_standard_error(factor, words):
    (warning,) = compliance_warnings(NOMINAL * [1.0, factor, 1.0], ERROR, NOMINAL)
    assert "joint 2" in warning and words in warning and "± 0.02" in warning
    assert f"{factor:.3g} ±" in warning
    assert "joint 1" not in warning and "joint 3" not in warning and "by chance" not in warning


def test_beside_usual_values_only_what_is_off_by_orders_of_magnitude_is_named():
    assert compliance_warnings(0.9 * MOST_OFF_USUAL * NOMINAL, ERROR, NOMINAL, known=False) == []
    (warning,) = compliance_warnings(NOMINAL * [1.0, 1000.0, 1.0], ERROR, NOMINAL, known=False)
    assert "1e+03 times usual for such a robot" in warning
    (warning,) = compliance_warnings(NOMINAL * [1.0, -1.0, 1.0], ERROR, NOMINAL, known=False)
    assert "negative, usual for such a robot 1" in warning
