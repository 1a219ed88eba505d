"""Intervals of errors against closed forms, and against the package's own on the same draws."""

import numpy as np
import pytest
from scipy import stats

from elastocal.audit.intervals import Errors, drawn, limits, log_ratio, metrics, reduction
from elastocal.validation import held_out

POSES = 12


def made(seed=1, poses=POSES):
    draws = np.random.default_rng(seed)
    pose = np.repeat(np.arange(poses), 4)
    common = draws.normal(size=poses)[pose]
    return Errors(tuple(size * np.abs(common + draws.normal(size=len(pose))) for size in (2.0, 1.0)), pose)


def test_intervals_are_those_of_the_package_by_the_same_draws():
    errors = made()
    theirs = [held_out.Errors(each, errors.pose) for each in errors.distances]
    expected, fallen = held_out.intervals(theirs, 1000, np.random.default_rng(5))
    counts = drawn(np.random.default_rng(5), errors.poses)
    for model in (0, 1):
        found = limits(errors, counts, model)
        for name in ("mean", "rms", "p95", "max"):
            np.testing.assert_allclose(found[name], expected[model][f"{name}_m"], rtol=1e-10)
    low, high, error = reduction(errors, counts, 0, 1)
    np.testing.assert_allclose([low, high, error], [fallen[1].low, fallen[1].high, fallen[1].std_error], rtol=1e-10)


@pytest.mark.parametrize("poses", [3, 400])
def test_few_poses_and_many_have_students_t(poses):
    assert drawn(np.random.default_rng(1), poses) is None
    over = np.random.default_rng(2).uniform(1, 2, poses)
    low, high, error = log_ratio(over, np.ones(poses), None)
    value = np.log(over.mean())
    np.testing.assert_allclose([low, high], value + error * np.array(stats.t.ppf([0.025, 0.975], poses - 1)))
    left = [np.log(np.delete(over, place).mean()) for place in range(poses)]
    assert error == pytest.approx(np.sqrt((poses - 1) * np.var(left)))


def test_a_ratio_that_is_the_same_at_every_pose_has_no_width():
    errors = made()
    alike = Errors((errors.distances[0], 0.5 * errors.distances[0]), errors.pose)
    low, high, error = reduction(alike, drawn(np.random.default_rng(1), POSES), 0, 1)
    assert (low, high) == (pytest.approx(0.5), pytest.approx(0.5)) and error == 0


def test_one_pose_has_no_interval():
    assert np.isnan(log_ratio(np.ones(1), np.ones(1), None)).all()


def test_metrics_of_a_few_errors():
    assert metrics(np.array([3.0, 4.0])) == {"mean": 3.5, "rms": np.sqrt(12.5), "p95": pytest.approx(3.95), "max": 4.0}
