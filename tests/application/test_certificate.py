"""The error budget: what each effect costs, and what a correction leaves."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import USUAL, made_calibrated

from elastocal.application.calibrated import OperatingConditions, forward, nominal_forward
from elastocal.application.certificate import REPEATABILITY, TOTAL, UNCERTAINTY, error_budget


def states(robot, count=60, force=300.0, seed=0):
    rng = np.random.default_rng(seed)
    low, high = robot.joint_limits.T
    wrench = np.zeros((count, 6))
    wrench[:, :3] = force * rng.standard_normal((count, 3))
    return robot.reported_angles(rng.uniform(0.6 * low, 0.6 * high, (count, robot.joints))), OperatingConditions(wrench)


def budget(calibrated):
    return error_budget(calibrated, *states(calibrated.robot))


def rms(one, other):
    return np.sqrt(((one - other) ** 2).sum(axis=1).mean())


def test_each_line_is_what_the_robot_misses_without_that_effect(fanuc):
    calibrated = made_calibrated(fanuc, *USUAL)
    found = budget(calibrated)
    angles, operating = states(fanuc)
    whole, _ = forward(calibrated, angles, operating)
    assert found[TOTAL] == pytest.approx(rms(whole, nominal_forward(fanuc, angles)[0]))
    for name in ("joint_offset", "link_geometry", "joint_compliance", "link_weight"):
        values = tuple(
            0.0 * value if effect.effect == name else value
            for effect, value in zip(calibrated.model.effects, calibrated.estimate.coefficients, strict=True)
        )
        without = replace(calibrated, estimate=replace(calibrated.estimate, coefficients=values))
        assert found[name] == pytest.approx(rms(whole, forward(without, angles, operating)[0]))
    names = list(found)
    assert names[0] == TOTAL and names[-2:] == [UNCERTAINTY, REPEATABILITY]
    middle = [found[name] for name in names[1:-2]]
    assert middle == sorted(middle, reverse=True)
