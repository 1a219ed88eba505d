"""Simulated data that were altered are found; such as they were drawn hold."""

import pytest
from made_audits import altered, failed

from elastocal_proof.audit import data

EXPERIMENTS, IDEAL = "data/simulated/two/experiments.parquet", "data/simulated/two/ideal.parquet"
MEASURED = "data/simulated/two/100um/measured.parquet"


def test_data_as_they_were_drawn_hold(run):
    assert failed(data.experiments(run, EXPERIMENTS, "two")) == []
    assert failed(data.ideal(run, IDEAL, "two")) == []
    assert failed(data.measured(run, MEASURED, "two", "100")) == []


@pytest.mark.parametrize(("column", "word"), [("q2", "joint angles"), ("my", "wrenches"), ("data_set", " once")])
def test_an_altered_experiment_is_found(run, column, word):
    altered(run, EXPERIMENTS, column, 7, 1)
    assert any(word in checked for checked in failed(data.experiments(run, EXPERIMENTS, "two")))


def test_an_altered_deflection_is_found(run):
    altered(run, IDEAL, "dz", slice(None), 1e-8)
    assert any("deflection" in checked for checked in failed(data.ideal(run, IDEAL, "two")))


def test_noise_of_another_size_is_found(run):
    found = failed(data.measured(run, MEASURED, "two", "50"))
    assert any("measured deflection" in checked for checked in found)
