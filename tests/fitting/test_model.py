"""The model that a campaign declares."""

from dataclasses import replace

import numpy as np
import pytest
from support import robot_of
from synthetic import made_measurements, made_model

from elastocal.campaigns.campaign import Campaign, Target
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.model import declared_model
from elastocal.mechanics.robot import Mass

TARGETS = Target("A", "6DoF", None), Target("B", "3DoF", (0.1, 0.0, -0.2))


@pytest.mark.parametrize(("measured", "rows"), [("position", 3), ("pose", 6)])
@pytest.mark.parametrize(("frame", "fitted"), [("tracker", True), ("base", False)])
@pytest.mark.parametrize("compliance", ["nominal", "identify"])
def test_declared_model_is_that_of_the_campaign(fanuc, measured, rows, frame, fitted, compliance):
    bare = made_model(fanuc.chain, (Target("A", "6DoF", (0, 0, 0)),))
    measurements = made_measurements(bare, np.random.default_rng(0), 2, 1, 0.0, 0.0)
    measurements = replace(measurements, time_s=np.array([7.0, 5.0]), row=np.array([4, 9]))
    campaign = Campaign("c", fanuc, measured, frame, TARGETS, compliance, (), None, {}, measurements)
    offset = candidates_on(made_model(fanuc.chain).sites)["joint_offset@2"]
    model = declared_model(campaign, (offset,))
    assert (model.rows, model.fitted_frames, model.targets) == (rows, fitted, TARGETS)
    assert model.identifies_compliance == (compliance == "identify")
    assert [effect.key for effect in model.effects][-1] == "joint_offset@2"
    np.testing.assert_array_equal(model.nominal_compliance, fanuc.compliance)
    assert model.time_zero_s == 5.0 and model.row_span == (4, 9)


def test_declared_model_weighs_what_the_robot_file_weighs(fanuc):
    bare = made_model(fanuc.chain, (Target("A", "6DoF", (0, 0, 0)),))
    measurements = made_measurements(bare, np.random.default_rng(0), 2, 1, 0.0, 0.0)
    robot = replace(fanuc, masses=(Mass(2, 100.0, (0.5, 0.0, 0.0), 0.1),), gravity_m_s2=(0.0, 0.0, 9.0), gear_ratio=(None,) * 6)
    model = declared_model(Campaign("c", robot, "position", "base", TARGETS, "identify", (), None, {}, measurements))
    assert [effect.key for effect in model.effects] == ["joint_compliance", "declared_weight"]
    assert model.sites.masses == robot.masses and model.sites.gravity_m_s2 == (0.0, 0.0, 9.0)


@pytest.mark.parametrize(
    ("chain", "slides"), [("Tz(q1) Tz(0.5) Ry(q2) Tx(1) [end]", True), ("Rz(q1) Tz(0.5) Ry(q2) Tx(1) [end]", False)]
)
def test_a_usual_weight_loads_an_arm_that_slides_and_of_which_neither_masses_nor_loads_are_known(chain, slides):
    robot, target = robot_of(chain), (Target("A", "end", (0, 0, 0)),)
    measurements = made_measurements(made_model(robot.chain, target), np.random.default_rng(0), 2, 1, 0.0, 0.0)

    def usual(robot, measurements):
        campaign = Campaign("c", robot, "position", "base", target, "nominal", (), None, {}, measurements)
        return declared_model(campaign).sites.usual_weight

    unloaded = replace(measurements, wrench=np.zeros_like(measurements.wrench))
    loaded = replace(measurements, wrench=np.ones_like(measurements.wrench))
    assert usual(robot, unloaded) == slides
    assert not usual(robot, loaded)
    assert not usual(replace(robot, masses=(Mass(1, 10.0, (0.1, 0.0, 0.0), 0.1),)), unloaded)
