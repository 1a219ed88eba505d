"""The error budget: what each effect costs, and what a correction leaves."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import USUAL, made_calibrated
from support import robot_of

from elastocal.application.calibrated import OperatingConditions, forward, nominal_forward
from elastocal.application.certificate import REPEATABILITY, TOTAL, UNCERTAINTY, error_budget


def states(robot, count=60, force=300.0, seed=0):
    rng = np.random.default_rng(seed)
    low, high = robot.joint_limits.T
    wrench = np.zeros((count, 6))
    wrench[:, :3] = force * rng.standard_normal((count, 3))
    return robot.reported_angles(rng.uniform(0.6 * low, 0.6 * high, (count, robot.joints))), OperatingConditions(wrench)


def budget(calibrated, draws=2000, **options):
    lines = error_budget(calibrated, *states(calibrated.robot, **options), draws, np.random.default_rng(1))
    return {line.name: line for line in lines}


def rms(one, other):
    return np.sqrt(((one - other) ** 2).sum(axis=1).mean())


def test_each_line_is_what_the_robot_misses_without_that_effect(fanuc):
    calibrated = made_calibrated(fanuc, *USUAL)
    found = budget(calibrated)
    angles, operating = states(fanuc)
    whole, _ = forward(calibrated, angles, operating)
    assert found[TOTAL].rms_m == pytest.approx(rms(whole, nominal_forward(fanuc, angles)[0]))
    for name in ("joint_offset", "link_geometry", "joint_compliance", "link_weight"):
        values = tuple(
            0.0 * value if effect.effect == name else value
            for effect, value in zip(calibrated.model.effects, calibrated.estimate.coefficients, strict=True)
        )
        without = replace(calibrated, estimate=replace(calibrated.estimate, coefficients=values))
        assert found[name].rms_m == pytest.approx(rms(whole, forward(without, angles, operating)[0]))
    names = list(found)
    assert names[0] == TOTAL and names[-2:] == [UNCERTAINTY, REPEATABILITY]
    middle = [found[name].rms_m for name in names[1:-2]]
    assert middle == sorted(middle, reverse=True)


def test_a_parameter_known_to_a_tenth_has_a_line_known_to_a_tenth():
    """One joint offset: the line is |a| times its lever, and so is its interval."""
    calibrated = made_calibrated(robot_of("Rz(q1) Tx(1.0) Ry(q2) Tx(0.5) [tip]"), "joint_offset@2", identified=False)
    value = calibrated.estimate.coefficients[0][0]
    line = budget(replace(calibrated, covariance=np.array([[(0.1 * value) ** 2]])), 20_000)["joint_offset"]
    assert line.rms_m == pytest.approx(0.5 * abs(value), rel=1e-3)
    assert line.low_m / line.rms_m == pytest.approx(1 - 0.196, abs=0.01)
    assert line.high_m / line.rms_m == pytest.approx(1 + 0.196, abs=0.01)


def test_a_shape_that_is_known_widens_no_line(fanuc):
    """It does not contribute in proportion: the interval is that of the linear parameter, known to a tenth."""
    calibrated = made_calibrated(fanuc, "lost_motion@2", identified=False)
    value = calibrated.estimate.coefficients[-1][0]
    covariance = np.zeros_like(calibrated.covariance)
    covariance[-2, -2] = (0.1 * value) ** 2
    line = budget(replace(calibrated, covariance=covariance), 20_000)["lost_motion"]
    assert line.low_m / line.rms_m == pytest.approx(1 - 0.196, abs=0.01)
    assert line.high_m / line.rms_m == pytest.approx(1 + 0.196, abs=0.01)
