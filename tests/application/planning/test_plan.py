"""A plan as a whole: better than chance, within the cell, and judged on poses that it did not choose."""

from dataclasses import replace

import numpy as np
import pytest
from made_surveys import OPEN, PULL, made_candidates, made_survey

from elastocal.application.planning.plan import (
    REPEATED_POSES,
    REPEATS,
    Candidates,
    Loads,
    accuracy_rows,
    choose_plan,
    find_allowed_candidates,
    information,
    model_of,
    observe,
    sheet,
)
from elastocal.campaigns.campaign import Target
from elastocal.errors import InputError
from elastocal.fitting.least_squares import fit
from elastocal.fitting.model import conditions, parameters, predict
from elastocal.fitting.noise import Noise
from elastocal.mechanics.robot_file import robot_from_document


@pytest.fixture(scope="module")
def survey():
    return made_survey()


@pytest.fixture(scope="module")
def some(survey):
    return made_candidates(survey, 300)


@pytest.mark.parametrize("kind", ["D", pytest.param("A", marks=pytest.mark.slow), "I"])
def test_a_plan_is_better_than_random_designs(survey, some, kind):
    plan = choose_plan(survey, some, 16, 5, kind, 1)
    assert plan.accuracy_m[-1] < np.quantile(plan.random_m[:, -1], 0.5)
    assert 0.2 < plan.efficiency <= 1.0
    assert (np.diff(plan.accuracy_m) <= 1e-12).all()


def test_no_pose_judges_that_is_fitted(survey, some):
    few = some.at(np.arange(21))
    plan = choose_plan(survey, few, 16, 5, "D", 1)
    both = np.concatenate([plan.fitted.joint_angles, plan.held_out.joint_angles])
    assert len(np.unique(both, axis=0)) == 21


def test_candidates_lie_within_the_limits_and_the_loads_pull_or_hang(survey, some):
    robot = survey.robot
    low, high = robot.joint_limits.T
    angles = robot.model_angles(some.joint_angles)
    assert (angles >= low).all() and (angles <= high).all()
    np.testing.assert_allclose(np.linalg.norm(some.force, axis=1), 100.0)
    hung = find_allowed_candidates(survey, OPEN, Loads(50.0, False), 20, 1)
    np.testing.assert_allclose(hung.force, np.tile([0, 0, -50.0], (20, 1)))
    assert Loads(0.0, False).shares == (0.0,) and PULL.shares == (0.0, 1.0, -1.0)


def test_too_few_poses_are_refused_with_how_many_it_takes(survey, some):
    with pytest.raises(InputError, match="at least"):
        choose_plan(survey, some, 2, 5, "D", 1)
    with pytest.raises(InputError, match="more candidates"):
        choose_plan(survey, some, 298, 5, "D", 1)


def test_targets_that_no_joint_moves_are_refused(survey, some):
    document = {"name": "turntable", "chain": "Tz(d1) [elbow] Rz(q1) [tool0]", "lengths_m": {"d1": 0.4}}
    robot = robot_from_document(document)
    for target in (Target("foot", "elbow", (0.1, 0.0, 0.0)), Target("axis", "tool0", (0.0, 0.0, 0.0))):
        still = replace(survey, robot=robot, targets=(target,), shares=(0.0,), unknown_base=False)
        turns = Candidates(np.linspace(-1.0, 1.0, 60)[:, None], np.zeros((60, 3)))
        with pytest.raises(InputError, match="no joint moves"):
            choose_plan(still, turns, 16, 5, "D", 1)


@pytest.fixture(scope="module")
def planned():
    """A survey, its plan and its sheet."""
    survey = made_survey()
    plan = choose_plan(survey, made_candidates(survey, 300), 14, 4, "D", 1)
    return survey, plan, sheet(survey, plan)


def test_each_state_of_each_pose_is_a_row_and_the_first_poses_are_repeated(planned):
    table = planned[2]
    assert len(table) == 3 * 18 + 2 * (REPEATS - 1) * REPEATED_POSES
    assert table[["x", "y", "z"]].isna().all().all() and "rx" not in table
    assert set(table.loc[table["repeat"] > 0, "pose"]) == set(range(1, REPEATED_POSES + 1))
    np.testing.assert_allclose(table.loc[table["load"] == 0, ["fx", "fy", "fz"]], 0.0)


@pytest.mark.parametrize("measured", ["position", "pose"])
def test_information_is_the_inverse_of_the_covariance_of_a_fit_with_priors(measured):
    survey = made_survey(measured=measured)
    some = made_candidates(survey, 40)
    model, estimate = model_of(survey)
    # The fit takes the priors that the plan takes: a plausible size each.
    effects = tuple(
        replace(e, parameters=tuple(replace(p, prior_std=p.plausible) for p in e.parameters)) for e in model.effects[1:]
    )
    model = replace(model, effects=(model.effects[0], *effects))
    seen = observe(survey, some.joint_angles, some.force)
    position, rotation = predict(model, estimate, seen, conditions(model, estimate, seen.states))
    exact = replace(seen, position=position, rotation=None if seen.rotation is None else rotation)
    noise = Noise("declared", survey.position_m, survey.orientation_rad, np.zeros(6))
    found = fit(model, exact, noise, estimate)
    rows = information(survey, some.joint_angles, some.force)
    scale = np.array([p.plausible for _, p in parameters(model, estimate)])
    free = np.array([owner.startswith(("frame", "target", "joint_compliance")) for owner, _ in parameters(model, estimate)])
    prior = np.diag(np.where(free, 0.0, 1.0))
    here = np.flatnonzero(~found.held)
    assert len(here) > 30
    matrix = (prior + np.einsum("nki,nkj->ij", rows, rows))[np.ix_(here, here)]
    expected = np.linalg.inv(matrix) * np.outer(scale[here], scale[here])
    std = np.sqrt(np.diag(found.covariance))[here]
    np.testing.assert_allclose(std, np.sqrt(np.diag(expected)), rtol=0.02)


def test_what_a_placement_of_the_base_takes_up_is_no_error_unless_the_base_is_known():
    for unknown in (True, False):
        survey = replace(made_survey(), unknown_base=unknown)
        some = made_candidates(survey, 40)
        rows = accuracy_rows(survey, some.joint_angles, some.force)
        names = [(owner, parameter.name) for owner, parameter in parameters(*model_of(survey))]
        assert rows.shape == (40, 3, len(names))
        size = np.sqrt((rows**2).sum(axis=1).mean(axis=0))
        first = names.index(("joint_offset@1", "offset"))
        # The first axis turns the whole arm, as a base does that was placed otherwise.
        second = size[names.index(("joint_offset@2", "offset"))]
        # But for the load, which does not turn with it.
        assert (size[first] < 1e-2 * second) if unknown else (size[first] > 0.3 * second)
        assert not size[[number for number, (owner, _) in enumerate(names) if owner.startswith(("frame", "target"))]].any()
