"""Kinds of measurement: poses as elsewhere, one joint at a time, and encoders in closed form."""

import numpy as np
import pandas as pd
import pytest
from made_studies import few_of

from elastocal.study.steps.budget import budget_blocks
from elastocal.study.steps.measurement_kinds import kind_blocks, one_joint_at_a_time, simulate_encoders

REFLECTORS = {"one": [[0.1, 0.0, 0.1]], "three": [[0.1, 0.0, 0.1], [0.1, 0.1, 0.0], [0.1, -0.1, 0.0]]}


@pytest.fixture(scope="module")
def table(kuka):
    return pd.concat([pd.DataFrame(block) for block in kind_blocks(few_of(kuka), REFLECTORS, [1e-5])])


def test_poses_are_those_of_sets_of_points(kuka, table):
    (expected,) = budget_blocks(few_of(kuka), {"6DoF": ["6DoF"]})
    mine = table[table.kind == "pose"]
    np.testing.assert_allclose(mine.mean_square, expected["mean_square"], rtol=1e-9)


def test_more_scalars_leave_less_and_too_few_leave_nothing(table):
    last = table[table.length == 20].groupby("kind").mean_square.mean()
    assert last["three"] < last["one"]
    first = table[table.length == 1].groupby("kind").mean_square
    assert first.count()["one"] == 0 and first.count()["three"] == 6
    scalars = table.drop_duplicates("kind").set_index("kind").scalars
    assert (scalars["pose"], scalars["one"], scalars["three"], scalars["joint encoders, 10 µrad"]) == (6, 3, 9, 6)


def test_one_joint_turns_at_a_time(kuka):
    drawn = few_of(kuka).experiments(np.arange(2))
    angles = one_joint_at_a_time(drawn).joint_angles
    moved = angles != angles[:, :1]
    assert moved.sum(axis=2).max() == 1 and moved.any(axis=(0, 1)).all()


def test_encoders_see_each_joint_by_itself(kuka):
    study = few_of(kuka)
    sets = np.arange(6)
    silent = simulate_encoders(study, sets, study.experiments(sets), 0.0)
    torques = np.einsum("jjks->jks", silent.regressor)
    np.testing.assert_allclose(silent.deflection, torques * kuka.compliance[:, None, None], rtol=1e-12)
    assert np.count_nonzero(silent.regressor) == torques.size
