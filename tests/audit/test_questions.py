"""Data sets of the research questions are those of the study."""

import numpy as np

from elastocal_proof.audit.questions import estimate, simulate
from elastocal_proof.audit.streams import draw


def test_a_data_set_that_is_drawn_again_is_the_one_in_the_file(run):
    angles, wrenches = run.experiments("two")
    again = draw(run, "two", 2, 5)
    np.testing.assert_allclose(again[0], angles[2])
    np.testing.assert_allclose(again[1], wrenches[2])


def test_its_measurements_are_those_in_the_file(run):
    matrix, right = simulate(run, "two", 3, 5, "hand")
    stored = run.deflections("data/simulated/two/100um/measured.parquet", "hand")[3]
    np.testing.assert_allclose(right, stored.ravel(), atol=1e-12)
    assert matrix.shape == (30, 2)


def test_a_point_measured_again_has_noise_of_its_own(run):
    once, again = (simulate(run, "two", 0, 5, name)[1] for name in ("hand", "hand/again"))
    assert 1e-6 < np.abs(once - again).max() < 1e-3


def test_an_estimate_by_one_stage_is_least_squares(run):
    expected = np.linalg.lstsq(*simulate(run, "two", 1, 5, "hand"), rcond=None)[0]
    np.testing.assert_allclose(estimate(run, "two", "hand alone", 1, 5), expected)
