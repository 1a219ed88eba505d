"""Held-out poses: residuals agree with a direct calculation, errors are compared before
and after, and warnings appear where the figures do not support the claim."""

from dataclasses import replace

import numpy as np
import pytest
from made_loop_tables import CAMPAIGNS, effect_entry

from elastocal.diagnosis.diagnose import Diagnosis, Step
from elastocal.diagnosis.judge import generate_residual_blocks, judge
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import get_joint_compliances
from elastocal.fitting.noise import Noise
from elastocal.mechanics.elastostatics import compute_generalized_forces
from elastocal.mechanics.kinematics import compute_poses, compute_poses_and_jacobians
from elastocal.validation.held_out import METRICS
from elastocal.verdict import TrainingVerdict

NOISE = Noise("declared", 6e-5, 6e-5, np.zeros(6))


def make_diagnosis(case, steps):
    """A diagnosis whose verdict has the effects of the steps, and one warning that
    `judge` must not change."""
    names = [step.name.removeprefix("with ") for step in steps if step.kind == "effect"]
    template = CAMPAIGNS["named"]
    inherited = {
        name: getattr(template, name) for name in TrainingVerdict.__dataclass_fields__
    }
    noise = replace(
        template.noise,
        source=NOISE.source,
        position_m=NOISE.position_m,
        orientation_rad=NOISE.orientation_rad,
        joint_rad=tuple(NOISE.joint_rad.tolist()),
        degrees_of_freedom=0,
        pose_rad=0.0,
    )
    changes = {
        "effects": tuple(
            replace(effect_entry(name), family="geometry", heldout_gain=None)
            for name in names
        ),
        "heldout": None,
        "warnings": ("as it was",),
        "noise": noise,
    }
    no_rows = case.campaign.measurements.select(np.zeros(0, int))
    return Diagnosis(
        case,
        tuple(steps),
        None,
        TrainingVerdict(**inherited | changes),
        no_rows,
        Settings(),
    )


@pytest.fixture(scope="module")
def cases_and_steps(cases):
    """Training case, held-out case, and the steps of the training case from the frames
    to the zero offset of joint 3."""
    case = cases[0]
    members = [case.candidates["joint_offset@3"]]
    frames_model = replace(case.model, effects=())
    frames = fit_model(frames_model, case.observations, NOISE)
    declared = fit_model(case.model, case.observations, NOISE)
    final = fit_model(
        case.model.with_effects(members),
        case.observations,
        NOISE,
        declared.estimate.with_effects(members),
    )
    steps = (
        Step("frames and targets", "frames", frames),
        Step("declared model", "declared", declared),
        Step("with joint_offset", "effect", final),
    )
    return *cases, steps


def judge_steps(steps, case, held_out):
    return judge(make_diagnosis(case, steps), held_out, 1)


def list_residual_blocks(case, steps, held_out):
    diagnosis = make_diagnosis(case, steps)
    return list(generate_residual_blocks(diagnosis, judge(diagnosis, held_out, 1)))


def select_warnings_of_errors(judgement):
    """Warnings of the judgement, except those of poses outside the fitted range: four
    random poses among 14 may well contain one."""
    return [
        warning
        for warning in judgement.document["warnings"][1:]
        if "outside the range" not in warning
    ]


def predict_joint_angles(robot, fitted, measurements, offset_of_joint_3):
    """Joint angles of the deflected robot, by fixed-point iteration."""
    compliances = get_joint_compliances(fitted.model, fitted.estimate)
    angles = measurements.joint_angles
    # The load acts on the deflected robot.
    for _ in range(5):
        _, _, jacobian = compute_poses_and_jacobians(
            robot.chain, angles, robot.chain.end_effector
        )
        torques = compute_generalized_forces(jacobian, measurements.wrench)
        angles = measurements.joint_angles + torques * compliances
        angles[:, 2] += offset_of_joint_3
    return angles


def predict_positions(case, fitted, offset_of_joint_3):
    """Position of each measured target by the chain of the robot alone."""
    robot = case.campaign.robot
    measurements = case.campaign.measurements
    angles = predict_joint_angles(robot, fitted, measurements, offset_of_joint_3)
    positions = np.empty((len(measurements), 3))
    for number, target in enumerate(case.campaign.targets):
        is_of_target = measurements.target == number
        positions[is_of_target] = compute_poses(
            robot.chain, angles[is_of_target], robot.chain.point(target.point)
        )[0]
    return positions


def assert_residuals(block, stage, expected):
    residual = np.column_stack([block[f"{stage}_d{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(residual, expected, rtol=0, atol=1e-9)
    assert np.isnan(block[f"{stage}_rx"]).all()


def test_residuals_are_measured_minus_predicted_positions_in_the_order_of_the_rows(
    cases_and_steps,
):
    case, held_out, steps = cases_and_steps
    frames, _, final = (step.fitted for step in steps)
    offset = final.estimate.coefficients[-1][0]
    blocks = list_residual_blocks(case, steps, held_out)
    assert [block["held_out"].all() for block in blocks] == [False, True]
    for block, measured_case in zip(blocks, (case, held_out), strict=True):
        measurements = measured_case.campaign.measurements
        for name in ("row", "pose", "load", "repeat", "target"):
            np.testing.assert_array_equal(block[name], getattr(measurements, name))
        position = np.column_stack([block[axis] for axis in "xyz"])
        np.testing.assert_array_equal(position, measurements.position)
        before = predict_positions(measured_case, frames, 0.0)
        assert_residuals(block, "before", position - before)
        after = predict_positions(measured_case, final, offset)
        assert_residuals(block, "after", position - after)
    rows = np.concatenate([block["row"] for block in blocks])
    assert sorted(rows) == list(range(1, len(rows) + 1))


def test_the_verdict_compares_held_out_errors_before_and_after(cases_and_steps):
    case, held_out, steps = cases_and_steps
    judgement = judge_steps(steps, case, held_out)
    heldout = judgement.document["heldout"]
    before = heldout["before"]
    declared = heldout["declared"]
    after = heldout["after"]
    assert [row["kind"] for row in judgement.rows] == [step.kind for step in steps]
    assert set(declared) == set(after) == set(METRICS)
    assert before["rms_m"] == judgement.rows[0]["heldout_rms_m"]
    assert declared["rms_m"] == judgement.rows[1]["heldout_rms_m"]
    assert after["rms_m"] == judgement.rows[2]["heldout_rms_m"]
    assert after["rms_m"] < 0.3 * declared["rms_m"]
    reduction = 1 - after["rms_m"] / declared["rms_m"]
    low, high = heldout["reduction_ci95"]
    assert low < reduction < high
    states = held_out.observations.states
    assert heldout["poses"] == len(np.unique(states.pose))
    # The joints repeat exactly, and the mean of two measurements has half the variance
    # of one.
    repeats = states.repeats[held_out.observations.state]
    floor_m = 6e-5 * np.sqrt((3 / repeats).mean())
    assert heldout["noise_floor_rms_m"] == pytest.approx(floor_m)
    (effect,) = judgement.document["effects"]
    assert effect["heldout_gain"] == pytest.approx(reduction)
    assert select_warnings_of_errors(judgement) == []
    assert judge_steps(steps, case, held_out).document["heldout"] == heldout


def test_a_step_that_makes_predictions_worse_causes_a_warning(cases_and_steps):
    case, held_out, (frames, declared, final) = cases_and_steps
    worse_steps = (
        frames,
        replace(declared, fitted=final.fitted),
        replace(final, fitted=declared.fitted),
    )
    warnings = select_warnings_of_errors(judge_steps(worse_steps, case, held_out))
    beginning = "the RMS error of the validation poses grew from"
    assert any(warning.startswith(beginning) for warning in warnings)


def turn_joint_3(states, pose):
    """Turn joint 3 once around in one pose. That brings the joint out of its range, and
    does not move the target."""
    joint_angles = states.joint_angles.copy()
    joint_angles[states.pose == pose, 2] += 2.0 * np.pi
    return replace(states, joint_angles=joint_angles)


def test_poses_outside_the_fitted_range_are_counted_flagged_and_warned_of(
    cases_and_steps,
):
    case, held_out, steps = cases_and_steps
    observations = held_out.observations
    campaign = held_out.campaign
    pose = observations.states.pose.min()
    turned = replace(
        held_out,
        observations=replace(
            observations, states=turn_joint_3(observations.states, pose)
        ),
        campaign=replace(
            campaign, measurements=turn_joint_3(campaign.measurements, pose)
        ),
    )
    document = judge_steps(steps, case, turned).document
    by_range = document["heldout"]["outside_range"]
    count = document["heldout"]["poses"]
    assert 1 <= by_range["poses"] < count
    for range_name in ("outside", "inside"):
        assert by_range[range_name]["after"]["rms_m"] < 1e-3
    assert document["gross_errors"] == []
    sentence = f"{by_range['poses']} of {count} validation poses lie outside"
    assert sentence in document["warnings"][-1]
    training, validation = list_residual_blocks(case, steps, turned)
    assert not training["outside_range"].any()
    assert validation["outside_range"][validation["pose"] == pose].all()
    outside_poses = np.unique(validation["pose"][validation["outside_range"]])
    assert len(outside_poses) == by_range["poses"]


def test_a_regression_is_judged_if_the_campaign_asks_for_one_and_its_data_are_sound(
    cases_and_steps,
):
    case, held_out, steps = cases_and_steps
    diagnosis = make_diagnosis(case, steps)
    assert judge(diagnosis, held_out, 1).document["remainder"] is None
    campaign = replace(case.campaign, remainder="gaussian_process")
    with_regression = replace(diagnosis, case=replace(case, campaign=campaign))
    remainder = judge(with_regression, held_out, 1).document["remainder"]
    # Two thirds of the error are the offset of the final model, and no smooth error is
    # left.
    assert remainder["physics"] > 0.6
    assert abs(remainder["regression_share"]) < 0.1
    shares = [remainder[name] for name in ("physics", "regression_share", "left")]
    assert sum(shares) == pytest.approx(1.0)
    faults = CAMPAIGNS["fault of the data"].effects
    faulty = replace(
        with_regression, verdict=replace(with_regression.verdict, effects=faults)
    )
    assert judge(faulty, held_out, 1).verdict.remainder is None
