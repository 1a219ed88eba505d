"""Data sets in memory are those of the pipeline, by number."""

import numpy as np
from made_studies import SIZE, USUAL
from made_study_blocks import deflections_of, experiments_of, judge

from elastocal.study.in_memory import StudyInMemory
from elastocal.study.metrics import compute_position_errors
from elastocal.study.simulation import unpack_deflections


def study_of(robot):
    return StudyInMemory(robot, "kuka", 1, USUAL, SIZE)


def test_data_sets_of_studies_follow_on_each_other_without_overlap(kuka):
    """The first study after that of the tables begins where its data sets end."""
    later = study_of(kuka).measure(np.arange(4, 8), ("6DoF",))["6DoF"]
    whole = study_of(kuka).measure(np.arange(8), ("6DoF",))["6DoF"]
    np.testing.assert_array_equal(later.deflection, whole.deflection[..., 4:])
    assert len(np.unique(whole.deflection[0, 0])) == 8
    assert [sets.tolist() for sets in study_of(kuka).list_blocks(2)] == [[8, 9, 10, 11]]


def test_measurements_are_those_of_the_pipelines_steps(kuka):
    (block,) = deflections_of(kuka, experiments_of(kuka, 4, 5), SIZE.noise)["3DoF"]
    measurements = study_of(kuka).measure(np.arange(4), ("3DoF",))["3DoF"]
    np.testing.assert_allclose(
        np.moveaxis(measurements.deflection, (0, 1), (2, 1)),
        unpack_deflections(block),
        rtol=1e-12,
    )


def test_the_validation_set_of_the_study_of_the_tables_is_the_pipelines(kuka):
    validation = study_of(kuka).make_validation_set()
    models = 1.1 * kuka.compliance[None]
    np.testing.assert_allclose(
        compute_position_errors(validation, models),
        compute_position_errors(judge(kuka), models),
        rtol=1e-9,
    )
