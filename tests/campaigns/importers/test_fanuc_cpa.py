"""The FANUC with one joint moved at a time: made-up measurements as text come back as measurements of the chain."""

import pytest
from made_fanuc_sources import assert_holds
from support import refused

from elastocal.campaigns.importers import fanuc_cpa
from elastocal.campaigns.reading import read_campaign


def test_cpa_source_becomes_a_campaign_of_the_controllers_angles(cpa, config_folder, tmp_path):
    path, angles, positions = cpa
    fanuc_cpa.write_campaign(path, tmp_path / "campaign", "fanuc_cpa")
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
