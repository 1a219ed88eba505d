"""What an audit reads of a run."""

import numpy as np


def test_experiments_and_deflections_have_the_axes_of_data_sets_and_configurations(run):
    angles, wrench = run.experiments("two")
    assert (angles.shape, wrench.shape) == ((4, 5, 2), (4, 5, 6))
    assert run.deflections("data/simulated/two/ideal.parquet", "hand").shape == (4, 5, 6)


def test_a_sample_is_the_same_each_time_and_another_for_another_file(run):
    assert (run.pick("one", 1000) == run.pick("one", 1000)).all()
    assert (run.pick("one", 1000) != run.pick("other", 1000)).any()
    assert len(run.pick("one", 3)) == 3


def test_regressors_stand_point_by_point(run):
    both = run.regressors("two", 1, 2, ["hand"])
    expected = np.concatenate([run.regressor("two", 1, k, "hand") for k in range(2)])
    assert (both == expected).all()
