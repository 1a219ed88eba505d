"""Measured deflections: the ideal ones plus noise of the wanted size, and nothing else changed."""

import numpy as np
from made_study_blocks import deflections_of, experiments_of

from elastocal.study.simulation import measurement_noise
from elastocal.study.steps.columns import index_columns, to_deflections
from elastocal.study.steps.measure import measured_blocks

COMPONENTS = ("dx", "dy", "dz", "rx", "ry", "rz")


def make_zeros(sets, configurations, point="6DoF"):
    columns = index_columns(sets, configurations)
    rows = len(columns["data_set"])
    return {"point": np.full(rows, point, dtype=object)} | columns | {name: np.zeros(rows) for name in COMPONENTS}


def test_measurements_are_ideal_plus_scaled_noise_of_each_point(kuka):
    experiments = experiments_of(kuka)
    ideal = deflections_of(kuka, experiments)
    for noise in (5e-5, 5e-4):
        measured = deflections_of(kuka, experiments, noise)
        for name in ideal:
            error = to_deflections(measured[name][0]) - to_deflections(ideal[name][0])
            expected = noise * measurement_noise(1, "kuka", name, range(5), 4)
            np.testing.assert_allclose(error, expected, rtol=0, atol=1e-15)


def test_noise_of_a_data_set_is_the_same_in_whatever_block_it_stands():
    (whole,) = measured_blocks([make_zeros(range(4), 3)], "kuka", 1, 1e-4)
    parts = list(measured_blocks([make_zeros([0], 3), make_zeros([1, 2, 3], 3)], "kuka", 1, 1e-4))
    for name in COMPONENTS:
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), whole[name])
