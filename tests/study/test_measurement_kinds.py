"""Kinds of measurement: poses as elsewhere, one joint at a time, and encoders in closed form."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from made_studies import few_of

from elastocal.random_streams import draw
from elastocal.study.measurement_kinds import (
    few_blocks,
    kind_blocks,
    one_joint_at_a_time,
    simulate_encoders,
)
from elastocal.study.metrics import mean_square_errors
from elastocal.study.points import budget_blocks

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


TAU = 0.3


@pytest.fixture(scope="module")
def both(strategies):
    plain = strategies["6DoF"]
    return [plain, replace(plain, name="shrunk", prior_std=TAU)]


def test_shrunk_estimates_are_those_of_ridge_regression(kuka, both):
    study = few_of(kuka)
    (plain, shrunk) = list(few_blocks(study, both, [0.2]))
    measured = study.measure(np.arange(6), ("6DoF",))["6DoF"]
    normal = draw(1, "kuka", "nominal compliances", range(6), lambda stream: stream.standard_normal(6))
    for number in (0, 5):
        for length in (1, 4):
            A = measured.regressor[:, :, :length, number].transpose(2, 0, 1).reshape(-1, 6)
            y = measured.deflection[:, :length, number].T.ravel()
            nominal = kuka.compliance * np.exp(0.2 * normal[number])
            weight = np.diag((study.size.noise / (TAU * nominal)) ** 2)
            ridge = np.linalg.solve(A.T @ A + weight, A.T @ y + weight @ nominal)
            expected = mean_square_errors(study.judge().form, (ridge - kuka.compliance)[:, None])[0]
            row = (shrunk["data_set"] == number) & (shrunk["length"] == length)
            assert shrunk["mean_square"][row][0] == pytest.approx(expected, rel=1e-6)
    assert np.isfinite(plain["mean_square"]).all()


def test_least_squares_do_not_look_at_nominal_values(kuka, both):
    blocks = list(few_blocks(few_of(kuka), both, [0.1, 1.0]))
    np.testing.assert_array_equal(blocks[0]["mean_square"], blocks[2]["mean_square"])
    assert (blocks[1]["mean_square"] != blocks[3]["mean_square"]).all()
