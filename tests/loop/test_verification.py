"""Measurements at corrected targets become a further session of a campaign."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from analysed_robots import ROBOTS, analysed
from made_corrections import write_measured, write_targets
from made_folders import make_folder

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_campaign
from elastocal.errors import InputError
from elastocal.loop.verification import (
    join_measurements,
    name_next_round,
    read_verification,
)
from elastocal.mechanics.components import WRENCH_NAMES


def refuse(function, **options):
    """Return the message with which a function refuses its input."""
    with pytest.raises(InputError) as error:
        function(**options)
    return str(error.value)


@pytest.fixture
def join(tmp_path):
    """Joins measurements at ten targets to a campaign with these changes, whose poses
    from `afternoon` on are a session of their own."""

    def make_and_join(columns=None, afternoon=None, *, loaded=True, **changes):
        make_folder(tmp_path / "cell", analysed("kuka"), "cell", **changes)
        if not loaded:
            path = tmp_path / "cell" / "measurements.csv"
            sheet = pd.read_csv(path)
            sheet[[*WRENCH_NAMES]] = 0.0
            sheet.to_csv(path, index=False)
        if afternoon is not None:
            path = tmp_path / "cell" / "measurements.csv"
            sheet = pd.read_csv(path)
            sheet["session"] = (sheet["pose"] >= afternoon).astype(int)
            sheet.to_csv(path, index=False)
        folder = read_campaign_folder(tmp_path / "cell", ROBOTS)
        table = write_targets(tmp_path / "targets.csv")
        write_measured(tmp_path / "measured.csv", table, **(columns or {}))
        read = read_verification(
            tmp_path / "measured.csv",
            tmp_path / "targets.csv",
            read_campaign(folder),
            "m",
        )
        output, name = name_next_round(folder)
        remarks = join_measurements(folder, *read, output, name)
        joined = read_campaign_folder(output, ROBOTS)
        return read_campaign(folder), read_campaign(joined), remarks, table

    return make_and_join


def test_a_round_has_both_sessions_with_their_loads(join):
    before, joined, remarks, table = join()
    assert joined.name == "cell_round2" and not remarks
    both = joined.measurements
    further = both.select(both.session == before.measurements.session.max() + 1)
    assert len(further) == 10
    assert len(both) == len(before.measurements) + 10
    first = both.select(both.session != further.session[0])
    for field in ("position", "joint_angles", "wrench", "target", "repeat", "pose"):
        expected = getattr(before.measurements, field)
        np.testing.assert_allclose(getattr(first, field), expected, rtol=0, atol=0)
    np.testing.assert_array_equal(further.wrench[:, 2], table["fz"])
    np.testing.assert_array_equal(further.load, [0] * 5 + [1] * 5)
    np.testing.assert_allclose(further.position[:, 2], table["z"] + 1e-3)


def test_the_first_measurements_under_load_identify_compliances(join):
    """Without them a robot whose file states none is taken as rigid."""
    before, joined, remarks, _ = join(loaded=False, compliance="nominal")
    assert (before.compliance, joined.compliance) == ("nominal", "identify")
    assert remarks == [
        "compliance: identify, because these are the first measurements under load"
    ]


def test_held_out_poses_keep_their_session(join):
    *_, joined, _, _ = join(holdout={"poses": [1, 3]})
    assert joined.holdout == {"poses": [[0, 1], [0, 3]]}


def test_held_out_poses_of_several_sessions_keep_theirs(join):
    *_, joined, _, _ = join(holdout={"poses": [1, 3]}, afternoon=2)
    assert joined.holdout == {"poses": [[0, 1], [1, 3]]}


def test_a_robot_in_the_folder_goes_with_it(join, tmp_path):
    folder = tmp_path / "cell"
    folder.mkdir()
    text = (Path(ROBOTS) / "kuka.yaml").read_text(encoding="utf-8")
    (folder / "arm.yaml").write_text(text, encoding="utf-8")
    join(robot="arm.yaml")
    document = yaml.safe_load((tmp_path / "cell_round2/campaign.yaml").read_text())
    assert document["robot"] == "robot.yaml"
    assert (tmp_path / "cell_round2/robot.yaml").read_text(encoding="utf-8") == text


def test_a_campaign_of_poses_needs_orientations(join):
    assert "orientation" in refuse(join, measured="pose")


def test_rounds_are_counted(tmp_path):
    make_folder(tmp_path / "any", analysed("kuka"), "cell_round2")
    folder = read_campaign_folder(tmp_path / "any", ROBOTS)
    assert name_next_round(folder) == (tmp_path / "cell_round3", "cell_round3")
