"""Scores of models against closed forms."""

import numpy as np
import pytest

from elastocal_proof.audit.scores import average, errors_of, fixed_joints, moment


def test_the_true_compliances_leave_no_error(run):
    truth = run.arm("two").compliance
    assert errors_of(run, "two", truth[None]).max() < 1e-12
    off = errors_of(run, "two", 1.1 * truth[None])[0]
    assert (off**2).mean() == pytest.approx(0.01 * truth @ moment(run, "two") @ truth)


@pytest.mark.parametrize(("method", "expected"), [("stiffness", 1.5), ("compliance", 2.0), ("median", 2.0)])
def test_averages_of_one_and_three(method, expected):
    assert average(np.array([[1.0], [3.0]]), method)[0] == pytest.approx(expected)


def test_weights_count_data_sets_so_often():
    twice = average(np.array([[1.0], [3.0], [3.0]]), "stiffness")
    assert average(np.array([[1.0], [3.0]]), "stiffness", np.array([1, 2])) == pytest.approx(twice)


def test_the_fixed_joints_are_what_the_last_one_holds():
    stages = [{"points": ["a"], "joints": [1, 2]}, {"points": ["b"], "joints": [3], "held": [1, 2]}]
    assert fixed_joints({"stages": stages}).tolist() == [0, 1]
    assert fixed_joints({"stages": stages[:1]}).tolist() == [0, 1]
