"""Held-out poses: residuals by hand, errors before and after, and warnings where the
figures do not bear the claim."""

from dataclasses import fields, replace

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


def diagnosis_of(case, steps):
    """A diagnosis whose verdict has the effects of the steps and one warning that
    `judge` must leave alone."""
    names = [step.name.removeprefix("with ") for step in steps if step.kind == "effect"]
    made = CAMPAIGNS["named"]
    inherited = {
        entry.name: getattr(made, entry.name) for entry in fields(TrainingVerdict)
    }
    noise = replace(
        made.noise,
        source=NOISE.source,
        position_m=NOISE.position_m,
        orientation_rad=NOISE.orientation_rad,
        joint_rad=tuple(NOISE.joint_rad.tolist()),
        degrees_of_freedom=0,
        pose_rad=0.0,
    )
    verdict = TrainingVerdict(
        **inherited
        | {
            "effects": tuple(
                replace(effect_entry(name), family="geometry", heldout_gain=None)
                for name in names
            ),
            "heldout": None,
            "warnings": ("as it was",),
            "noise": noise,
        }
    )
    return Diagnosis(
        case,
        tuple(steps),
        None,
        verdict,
        case.campaign.measurements.select(np.zeros(0, int)),
        Settings(),
    )


@pytest.fixture(scope="module")
def made(cases):
    """Those cases, and the steps of the first, from frames to an offset."""
    case = cases[0]
    members = [cases[0].candidates["joint_offset@3"]]
    bare, declared = (
        fit_model(model, case.observations, NOISE)
        for model in (replace(case.model, effects=()), case.model)
    )
    final = fit_model(
        case.model.with_effects(members),
        case.observations,
        NOISE,
        declared.estimate.with_effects(members),
    )
    steps = (
        ("frames and targets", "frames", bare),
        ("declared model", "declared", declared),
    )
    return *cases, tuple(
        Step(*each) for each in (*steps, ("with joint_offset", "effect", final))
    )


def judged(steps, case, held_out):
    """Rows, errors and warnings of the verdict."""
    return judge(diagnosis_of(case, steps), held_out, 1)


def blocks_of(diagnosis, held_out):
    return list(generate_residual_blocks(diagnosis, judge(diagnosis, held_out, 1)))


def about_errors(found):
    """Warnings but for that of poses outside the fitted range, of which four random
    ones among 14 may well have one."""
    return [
        warning
        for warning in found.document["warnings"][1:]
        if "outside the range" not in warning
    ]


def fitted_of(steps, kind):
    return next(step.fitted for step in steps if step.kind == kind)


def test_residuals_are_measured_less_predicted_for_every_measurement_in_its_order(made):
    case, held_out, steps = made
    robot = case.campaign.robot
    blocks = blocks_of(diagnosis_of(case, steps), held_out)
    assert [block["held_out"].all() for block in blocks] == [False, True]
    for block, part in zip(blocks, (case, held_out), strict=True):
        read = part.campaign.measurements
        for name in ("row", "pose", "load", "repeat", "target"):
            np.testing.assert_array_equal(block[name], getattr(read, name))
        measured = read.position
        angles = read.joint_angles
        wrench = read.wrench
        np.testing.assert_array_equal(
            np.column_stack([block[axis] for axis in "xyz"]), measured
        )
        for stage, kind in (("before", "declared"), ("after", "effect")):
            fitted = fitted_of(steps, kind)
            moved = angles
            # The load is taken where the robot has yielded to it.
            for _ in range(5):
                end = compute_poses_and_jacobians(
                    robot.chain, moved, robot.chain.end_effector
                )[2]
                moved = angles + compute_generalized_forces(
                    end, wrench
                ) * get_joint_compliances(fitted.model, fitted.estimate)
                if kind == "effect":
                    moved[:, 2] += fitted.estimate.coefficients[-1][0]
            for number, target in enumerate(case.campaign.targets):
                mask = block["target"] == number
                predicted = compute_poses(
                    robot.chain, moved[mask], robot.chain.point(target.point)
                )[0]
                off = np.column_stack([block[f"{stage}_d{axis}"] for axis in "xyz"])[
                    mask
                ]
                np.testing.assert_allclose(
                    off, measured[mask] - predicted, rtol=0, atol=1e-9
                )
            assert np.isnan(block[f"{stage}_rx"]).all()
    rows = np.concatenate([block["row"] for block in blocks])
    assert sorted(rows) == list(range(1, len(rows) + 1))


def test_figures_before_and_after(made):
    case, held_out, steps = made
    found = judged(steps, case, held_out)
    assert [row["kind"] for row in found.rows] == [step.kind for step in steps]
    before = found.document["heldout"]["before"]
    after = found.document["heldout"]["after"]
    assert set(before) == set(after) == set(METRICS)
    assert (
        before["rms_m"] == found.rows[1]["heldout_rms_m"]
        and after["rms_m"] == found.rows[2]["heldout_rms_m"]
    )
    assert after["rms_m"] < 0.3 * before["rms_m"]
    low, high = found.document["heldout"]["reduction_ci95"]
    assert low < 1 - after["rms_m"] / before["rms_m"] < high
    assert found.document["heldout"]["poses"] == len(
        np.unique(held_out.observations.states.pose)
    )
    # No joint errs, and a mean of two measurements has half the square of the noise of
    # one.
    repeats = held_out.observations.states.repeats[held_out.observations.state]
    assert found.document["heldout"]["noise_floor_rms_m"] == pytest.approx(
        6e-5 * np.sqrt((3 / repeats).mean())
    )
    (gained,) = (effect["heldout_gain"] for effect in found.document["effects"])
    assert gained == pytest.approx(1 - after["rms_m"] / before["rms_m"])
    assert about_errors(found) == []
    again = judged(steps, case, held_out)
    assert again.document["heldout"] == found.document["heldout"]


def test_a_step_that_makes_predictions_worse_is_a_warning(made):
    case, held_out, (bare, declared, final) = made
    worse = (
        bare,
        replace(declared, fitted=final.fitted),
        replace(final, fitted=declared.fitted),
    )
    said = about_errors(judged(worse, case, held_out))
    assert any(
        warning.startswith("the RMS error of the validation poses grew from")
        for warning in said
    )


def test_poses_outside_the_fitted_range_are_counted_flagged_and_warned_of(made):
    """A whole turn brings the joint out of its range and the target nowhere else."""
    case, held_out, steps = made
    observations = held_out.observations
    measurements = held_out.campaign.measurements
    first = observations.states.pose.min()

    def turned(states):
        away = (
            2.0
            * np.pi
            * (states.pose == first)[:, None]
            * (np.arange(case.campaign.robot.joints) == 2)
        )
        return replace(states, joint_angles=states.joint_angles + away)

    moved = replace(observations, states=turned(observations.states))
    campaign = replace(held_out.campaign, measurements=turned(measurements))
    away = replace(held_out, observations=moved, campaign=campaign)
    found = judged(steps, case, away)
    beyond = found.document["heldout"]["outside_range"]
    poses = found.document["heldout"]["poses"]
    assert 1 <= beyond["poses"] < poses
    assert (
        max(beyond[where]["after"]["rms_m"] for where in ("outside", "inside")) < 1e-3
    )
    assert found.document["gross_errors"] == []
    assert (
        f"{beyond['poses']} of {poses} validation poses lie outside"
        in found.document["warnings"][-1]
    )
    training, unseen = blocks_of(diagnosis_of(case, steps), away)
    assert not training["outside_range"].any()
    assert unseen["outside_range"][unseen["pose"] == first].all()
    assert len(np.unique(unseen["pose"][unseen["outside_range"]])) == beyond["poses"]


def test_a_remainder_is_judged_where_the_campaign_asks_for_one_and_the_data_are_sound(
    made,
):
    case, held_out, steps = made
    found = diagnosis_of(case, steps)
    assert judge(found, held_out, 1).document["remainder"] is None
    asked = replace(
        found,
        case=replace(
            case, campaign=replace(case.campaign, remainder="gaussian_process")
        ),
    )
    facts = judge(asked, held_out, 1).document["remainder"]
    # Two thirds of the error are the offset that the final model has, and nothing
    # smooth is left.
    assert facts["physics"] > 0.6 and abs(facts["regression_share"]) < 0.1
    assert facts["physics"] + facts["regression_share"] + facts[
        "left"
    ] == pytest.approx(1.0)
    fault = CAMPAIGNS["fault of the data"].effects
    faulty = replace(asked, verdict=replace(asked.verdict, effects=fault))
    assert judge(faulty, held_out, 1).verdict.remainder is None
