"""Measurements and noise to files and back: what a later step reads is what an earlier one had."""

from dataclasses import replace

import numpy as np
import pytest
from made_folders import made_folder, made_table

from elastocal.campaigns.columns import columns_of, measurements_from
from elastocal.campaigns.reading import read_campaign
from elastocal.fitting.case import noise_facts, noise_from
from elastocal.fitting.noise import Noise
from elastocal.io.storage import read_table, write_table
from elastocal.loop.schemas import measurements

COVARIATES = {
    "none": {},
    "all": {"approach3": [1.0, -1.0], "time_s": [0.0, 5.0], "temperature_c": [20.0, 21.5]},
}


def there_and_back(path, schema, columns):
    write_table(path, schema, [columns], {})
    return read_table(path, schema)


@pytest.mark.parametrize("measured", ["position", "pose"])
@pytest.mark.parametrize("covariates", COVARIATES)
def test_measurements_come_back_as_they_were(measured, covariates, kuka, config_folder, tmp_path):
    table = made_table(kuka, "c")
    count = len(table["pose"])
    table |= {name: np.resize(values, count) for name, values in COVARIATES[covariates].items()}
    table |= {f"approach{joint}": np.zeros(count) for joint in range(1, 7) if joint != 3 and covariates == "all"}
    table["session"] = table["pose"] % 2
    folder = made_folder(tmp_path / "c", kuka, table=table, measured=measured)
    before = read_campaign(folder, config_folder / "robots").measurements
    assert (before.rotation_vector is None) == (measured == "position")
    assert (before.approach is None) == (before.time_s is None) == (covariates == "none")
    after = measurements_from(there_and_back(tmp_path / "r.parquet", measurements(6), columns_of(before)))
    for name, values in vars(before).items():
        if values is None:
            assert getattr(after, name) is None, name
        else:
            np.testing.assert_array_equal(getattr(after, name), values)
            assert getattr(after, name).dtype == values.dtype, name


def test_noise_comes_back_from_its_document():
    noise = Noise("repeats", 1e-5, 2e-5, np.array([1e-6, 0, 3e-6]), 77, 2e-6)
    back = noise_from({"noise": noise_facts(noise), "warnings": []})
    np.testing.assert_array_equal(back.joint_rad, noise.joint_rad)
    assert replace(back, joint_rad=None) == replace(noise, joint_rad=None)
