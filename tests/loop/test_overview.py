"""The overview of a campaign states what was read, what is testable and what is
suspicious."""

from dataclasses import replace

import pytest
from analysed_robots import ROBOTS
from made_folders import make_folder, make_table
from small_data import service_arm_folder

from elastocal.loop.overview import inspect_campaign


@pytest.fixture(scope="module")
def overview(kuka, tmp_path_factory):
    return inspect_campaign(
        make_folder(tmp_path_factory.mktemp("o") / "made", kuka), ROBOTS
    )


def find_sentences(overview, phrase):
    return [sentence for sentence in overview.attention if phrase in sentence]


def test_the_table_states_what_was_read_and_what_is_testable(
    overview,
):
    rows = dict(overview.rows)
    assert (
        overview.diagnosable
        and overview.testable > 20
        and rows["testable"].startswith(f"{overview.testable} candidate")
    )
    assert "6 joints" in rows["read"] and any(
        "position of 3DoF, 6DoF in the base frame" in text for _, text in overview.rows
    )
    assert any(" not testable: " in text for _, text in overview.rows)
    assert 1.0 < float(rows["noise"].split(" ")[0]) < 1000.0
    assert find_sentences(
        overview, "only one load besides the unloaded state"
    ) and find_sentences(overview, "held-out poses determine the error poorly")
    assert not find_sentences(overview, "poses are few")


def test_a_camera_has_no_tracker_frame():
    overview = inspect_campaign(ROBOTS.parents[1] / "data/measured/fr3_board", ROBOTS)
    texts = [text for _, text in overview.rows]
    assert "board of camera in a frame that is fitted in each session" in texts


def test_a_negative_compliance_is_reported(kuka, tmp_path):
    """It means that the declared model lacks an effect."""
    table = make_table(
        replace(kuka, compliance=kuka.compliance * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]),
        "made",
    )
    overview = inspect_campaign(
        make_folder(tmp_path / "made", kuka, table=table), ROBOTS
    )
    assert find_sentences(overview, "the compliance of joint 3 comes out negative")


def test_a_warning_of_few_poses_states_how_many_are_needed(
    tmp_path,
):
    (few,) = find_sentences(
        inspect_campaign(service_arm_folder(tmp_path / "made", 1), ROBOTS),
        "poses are few",
    )
    tokens = few.replace(",", "").replace(":", "").split(" ")
    parameters = int(tokens[5])
    effective = int(tokens[tokens.index("about") + 1])
    numbers = int(tokens[tokens.index("by") + 1])
    assert few.startswith("24 poses") and numbers == 72 and 9 <= effective < parameters
    assert int(few.split("Measure about ")[1].split(" ")[0]) > 48
