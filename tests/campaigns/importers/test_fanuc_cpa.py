"""The FANUC with one joint moved at a time: made-up measurements as text come back as measurements of the chain."""

import numpy as np
import pytest
from made_fanuc_sources import POSES, assert_holds
from support import refused

from elastocal.campaigns.importers import fanuc_cpa
from elastocal.campaigns.reading import read_campaign


def test_cpa_source_becomes_a_campaign_of_the_controllers_angles(cpa, config_folder, tmp_path):
    path, angles, positions = cpa
    fanuc_cpa.write_campaign(path, tmp_path / "campaign")
    campaign = read_campaign(tmp_path / "campaign", config_folder / "robots")
    assert [target.name for target in campaign.targets] == list("DEF")
    assert campaign.noise == fanuc_cpa.NOISE
    assert_holds(campaign.measurements, angles, positions)


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("", "", ["no row"]),
        ("1 2 3\n", "line 1", ["3 numbers", "21 finite numbers"]),
        (" ".join(21 * ["1"]) + "\n\n" + " ".join(20 * ["1"]) + " x\n", "line 3", ["no number"]),
        (" ".join(20 * ["1"]) + " nan\n", "line 1", ["21 finite numbers"]),
    ],
)
def test_text_of_other_rows_is_refused(tmp_path, text, key, words):
    path = tmp_path / "values.csv"
    path.write_text(text, encoding="utf-8")
    with refused(path, key, *words):
        fanuc_cpa.read(path)


def test_reflectors_in_millimetres_come_first_and_the_controllers_degrees_last(tmp_path):
    path = tmp_path / "values.csv"
    path.write_text(" ".join(map(str, [*range(1000, 1009), *6 * [7], 0, 90, 180, -90, 45, 30])) + "\n\n", encoding="utf-8")
    angles, positions = fanuc_cpa.read(path)
    np.testing.assert_allclose(angles, [np.pi * np.array([0, 1 / 2, 1, -1 / 2, 1 / 4, 1 / 6])], rtol=1e-15)
    assert list(positions) == ["D", "E", "F"]
    for name, first in zip("DEF", (1.0, 1.003, 1.006), strict=True):
        np.testing.assert_allclose(positions[name], [[first, first + 0.001, first + 0.002]], rtol=1e-15)


def test_poses_are_in_the_order_of_the_file(cpa, config_folder, tmp_path):
    fanuc_cpa.write_campaign(cpa[0], tmp_path / "campaign")
    measurements = read_campaign(tmp_path / "campaign", config_folder / "robots").measurements
    assert measurements.pose.tolist() == np.repeat(np.arange(POSES), 3).tolist() and not measurements.repeat.any()
