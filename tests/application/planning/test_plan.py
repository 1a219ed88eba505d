"""A plan as a whole: better than chance, within the limits, and judged on poses that it
did not choose."""

from dataclasses import replace

import numpy as np
import pytest
from made_surveys import OPEN, made_candidates, made_survey

from elastocal.application.planning.plan import (
    REPEATED_POSES,
    REPEATS,
    Candidates,
    accuracy_rows,
    build_sheet,
    choose_plan,
    find_allowed_candidates,
    information,
    model_of,
    observe,
)
from elastocal.campaigns.campaign import Target
from elastocal.errors import InputError
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import evaluate_conditions, list_parameters, predict
from elastocal.fitting.noise import Noise
from elastocal.mechanics.robot_file import robot_from_document


@pytest.fixture(scope="module")
def survey():
    return made_survey()


@pytest.fixture(scope="module")
def some(survey):
    return made_candidates(survey, 300)


def test_a_plan_is_better_than_random_designs_and_its_first_poses_are_repeated(
    survey, some
):
    plan = choose_plan(survey, some, 16, 5, 1)
    assert plan.accuracy_m[-1] < np.quantile(plan.random_m[:, -1], 0.5)
    assert (np.diff(plan.accuracy_m) <= 1e-12).all()
    table = build_sheet(survey, plan)
    assert len(table) == 3 * 21 + 2 * (REPEATS - 1) * REPEATED_POSES
    assert table[["x", "y", "z"]].isna().all().all() and "rx" not in table
    assert set(table.loc[table["repeat"] > 0, "pose"]) == set(
        range(1, REPEATED_POSES + 1)
    )
    np.testing.assert_allclose(table.loc[table["load"] == 0, ["fx", "fy", "fz"]], 0.0)


def test_no_pose_judges_that_is_fitted_and_too_few_are_refused(survey, some):
    plan = choose_plan(survey, some.at(np.arange(21)), 16, 5, 1)
    both = np.concatenate([plan.fitted.joint_angles, plan.held_out.joint_angles])
    assert len(np.unique(both, axis=0)) == 21
    for poses, words in ((2, "at least"), (298, "more candidates")):
        with pytest.raises(InputError, match=words):
            choose_plan(survey, some, poses, 5, 1)


def test_candidates_lie_within_the_limits_and_the_loads_pull_or_hang(survey, some):
    low, high = survey.robot.joint_limits.T
    angles = survey.robot.model_angles(some.joint_angles)
    assert (angles >= low).all() and (angles <= high).all()
    np.testing.assert_allclose(np.linalg.norm(some.force, axis=1), 100.0)
    hung = find_allowed_candidates(
        replace(survey, force_N=50.0, pulled=False), OPEN, 20, 1
    )
    np.testing.assert_allclose(hung.force, np.tile([0, 0, -50.0], (20, 1)), atol=1e-9)
    assert replace(survey, force_N=0.0).shares == (0.0,) and survey.shares == (
        0.0,
        1.0,
        -1.0,
    )


def test_targets_that_no_joint_moves_are_refused(survey):
    robot = robot_from_document(
        {
            "name": "t",
            "chain": "Tz(d1) [elbow] Rz(q1) [tool0]",
            "lengths_m": {"d1": 0.4},
        }
    )
    turns = Candidates(np.linspace(-1.0, 1.0, 60)[:, None], np.zeros((60, 3)))
    for target in (
        Target("foot", "elbow", (0.1, 0.0, 0.0)),
        Target("axis", "tool0", (0.0, 0.0, 0.0)),
    ):
        still = replace(
            survey, robot=robot, targets=(target,), force_N=0.0, unknown_base=False
        )
        with pytest.raises(InputError, match="no joint moves"):
            choose_plan(still, turns, 16, 5, 1)


@pytest.mark.parametrize("measured", ["position", "pose"])
def test_information_is_the_inverse_of_the_covariance_of_a_fit_with_priors(measured):
    survey = made_survey(measured=measured)
    some = made_candidates(survey, 40)
    model, estimate = model_of(survey)
    # The fit takes the priors that the plan takes: a plausible size each.
    effects = tuple(
        replace(
            e, parameters=tuple(replace(p, prior_std=p.plausible) for p in e.parameters)
        )
        for e in model.effects[1:]
    )
    model = replace(model, effects=(model.effects[0], *effects))
    seen = observe(survey, some.joint_angles, some.force)
    position, rotation = predict(
        model, estimate, seen, evaluate_conditions(model, estimate, seen.states)
    )
    exact = replace(
        seen, position=position, rotation=None if seen.rotation is None else rotation
    )
    noise = Noise("declared", survey.position_m, survey.orientation_rad, np.zeros(6))
    found = fit_model(model, exact, noise, estimate)
    rows = information(survey, some.joint_angles, some.force)
    scale = np.array([p.plausible for _, p in list_parameters(model, estimate)])
    free = np.array(
        [
            owner.startswith(("frame", "target", "joint_compliance"))
            for owner, _ in list_parameters(model, estimate)
        ]
    )
    prior = np.diag(np.where(free, 0.0, 1.0))
    here = np.flatnonzero(~found.unidentifiable)
    assert len(here) > 30
    matrix = (prior + np.einsum("nki,nkj->ij", rows, rows))[np.ix_(here, here)]
    expected = np.linalg.inv(matrix) * np.outer(scale[here], scale[here])
    np.testing.assert_allclose(
        np.sqrt(np.diag(found.covariance))[here], np.sqrt(np.diag(expected)), rtol=0.02
    )


def test_what_a_placement_of_the_base_takes_up_is_no_error_unless_the_base_is_known():
    for unknown in (True, False):
        survey = replace(made_survey(), unknown_base=unknown)
        some = made_candidates(survey, 40)
        rows = accuracy_rows(survey, some.joint_angles, some.force)
        names = [
            (owner, parameter.name)
            for owner, parameter in list_parameters(*model_of(survey))
        ]
        assert rows.shape == (40, 3, len(names))
        size = np.sqrt((rows**2).sum(axis=1).mean(axis=0))
        first, second = (
            size[names.index((f"joint_offset@{joint}", "offset"))] for joint in (1, 2)
        )
        # The first axis turns the whole arm, as a base does that was placed otherwise;
        # but for the load, which stays.
        assert (first < 1e-2 * second) if unknown else (first > 0.3 * second)
        assert not size[
            [
                number
                for number, (owner, _) in enumerate(names)
                if owner.startswith(("frame", "target"))
            ]
        ].any()


def test_an_unknown_offset_of_the_reflector_takes_up_the_last_link(survey):
    some = made_candidates(survey, 40)
    sizes = []
    for offset in (None, (0.0, 0.0, 0.0)):
        one = replace(
            survey,
            targets=(replace(survey.targets[0], offset_m=offset),),
            unknown_base=False,
        )
        last = [
            owner == "link_geometry@6" and p.unit == "m"
            for owner, p in list_parameters(*model_of(one))
        ]
        sizes.append(
            np.abs(accuracy_rows(one, some.joint_angles, some.force)[..., last]).max()
        )
    assert sizes[0] < 1e-2 * sizes[1]
