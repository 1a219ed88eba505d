"""Shrinkage from few configurations against ridge regression written out, and against plain least squares."""

from dataclasses import replace

import numpy as np
import pytest
from made_studies import few_of

from elastocal.random_streams import draw
from elastocal.study.metrics import mean_form, mean_square_errors
from elastocal.study.steps.few_configurations import few_blocks

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
            expected = mean_square_errors(mean_form(study.judge()), (ridge - kuka.compliance)[:, None])[0]
            row = (shrunk["data_set"] == number) & (shrunk["length"] == length)
            assert shrunk["mean_square"][row][0] == pytest.approx(expected, rel=1e-6)
    assert np.isfinite(plain["mean_square"]).all()


def test_least_squares_do_not_look_at_nominal_values(kuka, both):
    blocks = list(few_blocks(few_of(kuka), both, [0.1, 1.0]))
    np.testing.assert_array_equal(blocks[0]["mean_square"], blocks[2]["mean_square"])
    assert (blocks[1]["mean_square"] != blocks[3]["mean_square"]).all()
