"""Held-out poses: residuals by hand, controls from innocent families, and warnings where the figures do not bear the claim."""

from dataclasses import replace

import numpy as np
import pytest
from elastocal.attribution import by_effect
from elastocal.loop.judge import Step, controls, judged, model_steps, residual_blocks, split_table
from made_folders import made_folder, made_table
from scipy.spatial.transform import Rotation

from elastocal.elastostatics import generalized_forces
from elastocal.fitting import fit
from elastocal.held_out import METRICS
from elastocal.kinematics import poses, poses_and_jacobians
from elastocal.loop.case import case_from
from elastocal.loop.intake import taken_in
from elastocal.loop.reading_columns import reading_columns
from elastocal.model import joint_compliances
from elastocal.noise import Noise

NOISE = Noise("declared", 6e-5, 6e-5, np.zeros(6))
OFFSET = 1e-3


def cases(folder, robots):
    descriptions, training, held_out = taken_in(folder, robots)
    case = case_from(descriptions, reading_columns(training))
    return case, case_from(descriptions["held_out"] or descriptions, reading_columns(held_out))


def with_effects(case, declared, *keys):
    members = [case.candidates[key] for key in keys]
    return fit(case.model.with_effects(members), case.observations, NOISE, declared.estimate.with_effects(members)), members


@pytest.fixture(scope="module")
def made(kuka, config_folder, tmp_path_factory):
    """Training and held-out cases of a robot whose joint 3 stands 1 mrad off, and its steps."""
    folder = tmp_path_factory.mktemp("judge") / "made"
    made_folder(folder, kuka, table=made_table(kuka, "made", offset_of_joint_3=OFFSET))
    case, held_out = cases(folder, config_folder / "robots")
    declared = fit(case.model, case.observations, NOISE)
    final, members = with_effects(case, declared, "joint_offset@3")
    beside = [[case.candidates["cross_compliance@1+2"]], [case.candidates["payload"]]]
    return case, held_out, model_steps(case, NOISE, declared, final, by_effect(members), beside)


def about_errors(found):
    """Warnings but for that of poses outside the fitted range, of which four random ones among 14 may well have one."""
    return [warning for warning in found.warnings if "outside the range" not in warning]


def fitted_of(steps, kind):
    return next(step.fitted for step in steps if step.kind == kind)


def test_steps_go_from_frames_to_everything_found_and_controls_stand_beside(made):
    case, _, steps = made
    assert [(step.kind, step.name) for step in steps] == [
        ("frames", "frames and targets"),
        ("declared", "declared model"),
        ("effect", "+ joint_offset"),
        ("control", "control: cross_compliance@1+2"),
        ("control", "control: payload"),
    ]
    names = [[effect.effect for effect in step.fitted.model.effects] for step in steps]
    assert names == [
        [],
        ["joint_compliance"],
        ["joint_compliance", "joint_offset"],
        ["joint_compliance", "cross_compliance"],
        ["joint_compliance", "payload"],
    ]
    for step in steps:
        assert len(step.fitted.residual) == len(case.observations)


def test_an_effect_is_added_to_all_before_it(made):
    case, _, steps = made
    declared = fitted_of(steps, "declared")
    final, members = with_effects(case, declared, "joint_offset@3", "payload", "joint_offset@2")
    found = model_steps(case, NOISE, declared, final, by_effect(members), [])
    assert [[effect.key for effect in step.fitted.model.effects[1:]] for step in found[2:]] == [
        ["joint_offset@3", "joint_offset@2"],
        ["joint_offset@3", "payload", "joint_offset@2"],
    ]
    assert found[-1].fitted is final


def test_residuals_are_measured_less_predicted_for_every_reading_in_its_order(made):
    case, held_out, steps = made
    robot = case.campaign.robot
    blocks = list(residual_blocks(steps, case, held_out))
    assert [block["held_out"].all() for block in blocks] == [False, True]
    for block, part in zip(blocks, (case, held_out), strict=True):
        read = part.campaign.readings
        # Repeats of one state stand in the order of their target: the rows still are all readings, each once.
        assert sorted(block["row"]) == sorted(read.row)
        order = np.argsort(read.row)[np.searchsorted(np.sort(read.row), block["row"])]
        for name in ("pose", "load", "repeat", "target"):
            np.testing.assert_array_equal(block[name], getattr(read, name)[order])
        measured, angles, wrench = read.position[order], read.joint_angles[order], read.wrench[order]
        np.testing.assert_array_equal(np.column_stack([block[axis] for axis in "xyz"]), measured)
        for stage, kind in (("before", "declared"), ("after", "effect")):
            fitted = fitted_of(steps, kind)
            moved = angles
            # The load is taken where the robot has yielded to it.
            for _ in range(5):
                end = poses_and_jacobians(robot.chain, moved, robot.chain.end_effector)[2]
                moved = angles + generalized_forces(end, wrench) * joint_compliances(fitted.model, fitted.estimate)
                if kind == "effect":
                    moved[:, 2] += fitted.estimate.coefficients[-1][0]
            for number, target in enumerate(case.campaign.targets):
                mask = block["target"] == number
                predicted = poses(robot.chain, moved[mask], robot.chain.point(target.point))[0]
                off = np.column_stack([block[f"{stage}_d{axis}"] for axis in "xyz"])[mask]
                np.testing.assert_allclose(off, measured[mask] - predicted, rtol=0, atol=1e-9)
            assert np.isnan(block[f"{stage}_rx"]).all()
    rows = np.concatenate([block["row"] for block in blocks])
    assert sorted(rows) == list(range(1, len(rows) + 1))


def test_each_reading_stands_by_itself_and_the_training_ones_come_first(made):
    """As many rows as readings, repeats included, though the fit averages them."""
    case, held_out, steps = made
    first, second = residual_blocks(steps, case, held_out)
    assert len(first["row"]) == len(case.campaign.readings) > len(case.observations)
    assert len(second["row"]) == len(held_out.campaign.readings)
    assert {*zip(first["session"], first["pose"], strict=True)}.isdisjoint(zip(second["session"], second["pose"], strict=True))


def test_figures_before_and_after(made):
    case, held_out, steps = made
    found = judged(steps, case, held_out, 1)
    assert [row["kind"] for row in found.rows] == [step.kind for step in steps]
    before, after = found.heldout["before"], found.heldout["after"]
    assert set(before) == set(after) == set(METRICS)
    assert before["rms_m"] == found.rows[1]["heldout_rms_m"] and after["rms_m"] == found.rows[2]["heldout_rms_m"]
    assert after["rms_m"] < 0.3 * before["rms_m"]
    low, high = found.heldout["reduction_ci95"]
    assert low < 1 - after["rms_m"] / before["rms_m"] < high
    assert found.heldout["poses"] == len(np.unique(held_out.observations.states.pose))
    # No joint errs, and a mean of two readings has half the square of the noise of one.
    repeats = held_out.observations.states.repeats[held_out.observations.state]
    assert found.heldout["noise_floor_rms_m"] == pytest.approx(6e-5 * np.sqrt((3 / repeats).mean()))
    assert about_errors(found) == []
    again = judged(steps, case, held_out, 1)
    assert again.heldout == found.heldout


def test_poses_outside_the_fitted_range_are_counted_flagged_and_warned_of(made):
    case, held_out, steps = made
    first = held_out.observations.states.pose.min()

    def turned(states):
        away = np.zeros(case.campaign.robot.joints)
        away[2] = 8.0
        return replace(states, joint_angles=states.joint_angles + (states.pose == first)[:, None] * away)

    observations, readings = held_out.observations, held_out.campaign.readings
    away = replace(
        held_out,
        observations=replace(observations, states=turned(observations.states)),
        campaign=replace(held_out.campaign, readings=turned(readings)),
    )
    found = judged(steps, case, away, 1)
    beyond, poses = found.heldout["outside_range"], found.heldout["poses"]
    assert 1 <= beyond["poses"] < poses
    # A pose that was not there at all is far off; the others bear the effect out.
    assert beyond["outside"]["after"]["rms_m"] > 0.1 > beyond["inside"]["after"]["rms_m"]
    assert f"{beyond['poses']} of {poses} validation poses lie outside" in found.warnings[-1]
    training, unseen = residual_blocks(steps, case, away)
    assert not training["outside_range"].any()
    assert unseen["outside_range"][unseen["pose"] == first].all()
    assert len(np.unique(unseen["pose"][unseen["outside_range"]])) == beyond["poses"]


def test_splits_stand_beside_the_held_out_errors(made):
    case, held_out, steps = made
    rows = split_table(steps, case, held_out, 1)
    assert [row["split"] for row in rows] == ["held out", *5 * ["joint space"]]
    found = judged(steps, case, held_out, 1).heldout
    assert (rows[0]["before_rms_m"], rows[0]["after_rms_m"]) == (found["before"]["rms_m"], found["after"]["rms_m"])
    assert rows[1]["after_rms_m"] < 0.5 * rows[1]["before_rms_m"]
    # The wall: what the held-out poses hold changes nothing but the first row.
    observations = held_out.observations
    spoiled = replace(held_out, observations=replace(observations, position=observations.position + 0.01))
    assert split_table(steps, case, spoiled, 1)[0] != rows[0]
    assert [row["after_rms_m"] for row in split_table(steps, case, spoiled, 1)[1:]] == [row["after_rms_m"] for row in rows[1:]]


@pytest.mark.parametrize("frame", ["base", "tracker"])
def test_a_session_held_out_is_placed_and_judged(frame, kuka, config_folder, tmp_path):
    table = made_table(kuka, "made", offset_of_joint_3=OFFSET)
    table["session"] = np.where(np.asarray(table["pose"]) % 3 == 0, 2, 1)
    if frame == "tracker":
        position = np.column_stack([table[axis] for axis in "xyz"])
        there = Rotation.from_rotvec([0.3, -0.2, 1.0]).apply(position) + np.array([2.0, -1.0, 0.5])
        position = np.where((table["session"] == 2)[:, None], there, position)
        table |= dict(zip("xyz", position.T, strict=True))
    made_folder(tmp_path / "made", kuka, table=table, frame=frame, holdout={"session": 2})
    case, held_out = cases(tmp_path / "made", config_folder / "robots")
    assert set(case.campaign.readings.session) == {1} and set(held_out.campaign.readings.session) == {2}
    declared = fit(case.model, case.observations, NOISE)
    final, members = with_effects(case, declared, "joint_offset@3")
    steps = model_steps(case, NOISE, declared, final, by_effect(members), [])
    found = judged(steps, case, held_out, 1).heldout
    assert found["after"]["rms_m"] < 1.5 * found["noise_floor_rms_m"] and found["after"]["rms_m"] < found["before"]["rms_m"]
    off = np.column_stack([list(residual_blocks(steps, case, held_out))[1][f"after_d{axis}"] for axis in "xyz"])
    assert np.sqrt((off**2).sum(axis=1).mean()) < 2e-4


def spoilt(fitted, offset):
    """The same fit with the offset of joint 3 elsewhere."""
    values = (*fitted.estimate.coefficients[:-1], np.array([offset]))
    return replace(fitted, estimate=replace(fitted.estimate, coefficients=values))


def test_a_maximum_that_grows_is_a_warning(made):
    case, held_out, steps = made
    wrong = spoilt(fitted_of(steps, "effect"), -2 * OFFSET)
    found = judged([*steps[:2], Step("+ joint_offset", "effect", wrong)], case, held_out, 1)
    assert found.heldout["after"]["max_m"] > found.heldout["before"]["max_m"]
    grown = [warning for warning in found.warnings if warning.startswith("the held-out max grew from ")]
    figures = [1e3 * found.heldout[stage]["max_m"] for stage in ("before", "after")]
    assert grown == [f"the held-out max grew from {figures[0]:.3f} to {figures[1]:.3f} mm"]
    assert "the step '+ joint_offset' raised the held-out RMS" in found.warnings


def test_a_control_that_does_as_well_is_a_warning(made):
    case, held_out, steps = made
    declared, effect, control = steps[1], steps[2], replace(steps[2], kind="control", name="control: x")
    found = judged([steps[0], declared, effect, control], case, held_out, 1)
    assert [warning for warning in found.warnings if "control" in warning] == [
        f"a control does as well: {1e3 * found.rows[3]['heldout_rms_m']:.3f} mm held-out RMS"
    ]
    better = replace(control, fitted=spoilt(effect.fitted, 0.8 * OFFSET))
    assert about_errors(judged([steps[0], declared, effect, better], case, held_out, 1)) == []


def test_one_step_of_several_that_harms_is_named(made):
    case, held_out, steps = made
    worse = Step("+ other", "effect", spoilt(steps[2].fitted, 0.5 * OFFSET))
    found = judged([*steps[:3], worse], case, held_out, 1)
    assert "the step '+ other' raised the held-out RMS" in found.warnings
    assert not any("'+ joint_offset'" in warning for warning in found.warnings)


def test_nothing_found_has_nothing_to_warn_of(made):
    case, held_out, steps = made
    found = judged(steps[:2], case, held_out, 1)
    assert about_errors(found) == [] and found.heldout["before"] == found.heldout["after"]
    assert found.heldout["reduction_ci95"] == [0.0, 0.0] and found.heldout["reduction_std_error"] == 0.0


def test_without_a_known_noise_there_is_no_floor(made):
    case, held_out, steps = made
    noise = replace(NOISE, source="residual")
    steps = [replace(step, fitted=replace(step.fitted, noise=noise)) for step in steps[:3]]
    assert judged(steps, case, held_out, 1).heldout["noise_floor_rms_m"] is None


def test_another_campaign_as_test_has_frames_and_targets_of_its_own(kuka, config_folder, tmp_path):
    """Training in base axes; the test from a tracker that stands elsewhere."""
    table = made_table(kuka, "other", seed=2, offset_of_joint_3=OFFSET)
    turn, shift = Rotation.from_rotvec([0.3, -0.2, 1.0]), np.array([2.0, -1.0, 0.5])
    position = turn.apply(np.column_stack([table[axis] for axis in "xyz"])) + shift
    table |= dict(zip("xyz", position.T, strict=True))
    targets = {"of the other": {"point": "6DoF", "offset_m": "unknown"}}
    kept = table["target"] == "6DoF"
    table = {name: values[kept] for name, values in table.items()} | {"target": np.full(kept.sum(), "of the other")}
    made_folder(tmp_path / "other", kuka, "other", table=table, frame="tracker", targets=targets)
    own = made_table(kuka, "made", offset_of_joint_3=OFFSET)
    made_folder(tmp_path / "made", kuka, table=own, holdout={"campaign": "../other"})
    case, held_out = cases(tmp_path / "made", config_folder / "robots")
    assert case.campaign.name == "made" and held_out.campaign.name == "other"
    assert len(case.campaign.readings) == len(own["pose"])
    declared = fit(case.model, case.observations, NOISE)
    final, members = with_effects(case, declared, "joint_offset@3")
    steps = model_steps(case, NOISE, declared, final, by_effect(members), [])
    found = judged(steps, case, held_out, 1)
    assert found.heldout["after"]["rms_m"] < 1.3 * found.heldout["noise_floor_rms_m"]
    assert found.heldout["after"]["rms_m"] < found.heldout["before"]["rms_m"]
    blocks = list(residual_blocks(steps, case, held_out))
    off = np.column_stack([blocks[1][f"after_d{axis}"] for axis in "xyz"])
    assert np.sqrt((off**2).sum(axis=1).mean()) < 2e-4


def tables_for_controls(candidates, innocent, angles):
    """Looks in which only some candidates are innocent, and angles of all to what was found."""
    keys = np.array(list(candidates))
    looks = {
        "look": np.zeros(len(keys), int),
        "candidate": keys,
        "p_family": np.where(np.isin(keys, innocent), 0.5, 0.001),
    }
    rivals = {"candidate": keys, "angle_deg": np.array([angles.get(key, 10.0) for key in keys])}
    return looks, rivals


def test_controls_are_innocent_and_of_other_families(made):
    candidates = made[0].candidates
    for found_keys in (["joint_offset@3"], ["base_compliance", "link_weight@2"], ["link_elasticity@2", "hysteresis@1"]):
        found = by_effect([candidates[key] for key in found_keys])
        looks, rivals = tables_for_controls(candidates, list(candidates)[::2], {})
        groups = controls(looks, rivals, found, candidates)
        assert 1 <= len(groups) <= 2
        families = {member.family for members in found.values() for member in members}
        for group in groups:
            assert len({candidate.family for candidate in group}) == 1
            assert group[0].family not in families
            assert all(candidate.key in list(candidates)[::2] for candidate in group)


def test_controls_have_at_least_as_many_parameters_and_the_largest_angles(made):
    candidates = made[0].candidates
    found = by_effect([candidates["base_compliance"]])
    wanted = len(candidates["base_compliance"].parameters)
    innocent = ["joint_offset@1", "joint_offset@2", "joint_offset@3", "joint_offset@4", "hysteresis@1", "payload"]
    angles = {
        "joint_offset@4": 90.0,
        "joint_offset@3": 80.0,
        "joint_offset@2": 70.0,
        "joint_offset@1": 60.0,
        "hysteresis@1": 95.0,
    }
    groups = controls(*tables_for_controls(candidates, innocent, angles), found, candidates)
    # The gearbox stands farthest off and has too few; geometry has enough.
    assert [candidate.key for candidate in groups[0]] == ["joint_offset@4", "joint_offset@3", "joint_offset@2"][:wanted]
    assert [candidate.family for group in groups for candidate in group].count("gearbox") in (0, 1)


def test_no_controls_where_nothing_was_found(made):
    candidates = made[0].candidates
    assert controls(*tables_for_controls(candidates, list(candidates), {}), {}, candidates) == []
