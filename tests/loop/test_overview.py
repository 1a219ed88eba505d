"""What is said of a campaign before it is diagnosed."""

from dataclasses import replace

import pytest
from analysed_robots import ROBOTS
from made_folders import make_folder, make_table
from small_data import service_arm_folder

from elastocal.loop.overview import inspect_campaign


@pytest.fixture(scope="module")
def found(kuka, tmp_path_factory):
    return inspect_campaign(
        make_folder(tmp_path_factory.mktemp("o") / "made", kuka), ROBOTS
    )


def said(found, words):
    return [sentence for sentence in found.attention if words in sentence]


def test_what_was_read_and_can_be_tested_stands_in_the_table_and_what_is_little_below(
    found,
):
    rows = dict(found.rows)
    assert (
        found.diagnosable
        and found.testable > 20
        and rows["testable"].startswith(f"{found.testable} candidate")
    )
    assert "6 joints" in rows["read"] and any(
        "position of 3DoF, 6DoF in the base frame" in words for _, words in found.rows
    )
    assert any(" not testable: " in words for _, words in found.rows)
    assert 1.0 < float(rows["noise"].split(" ")[0]) < 1000.0
    assert said(found, "one load beside none") and said(
        found, "held-out poses say little"
    )
    assert not said(found, "poses are few")


def test_a_compliance_that_comes_out_negative_is_said(kuka, tmp_path):
    """What the declared model lacks hides behind it, and behind all others."""
    table = make_table(
        replace(kuka, compliance=kuka.compliance * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]),
        "made",
    )
    found = inspect_campaign(make_folder(tmp_path / "made", kuka, table=table), ROBOTS)
    assert said(found, "the compliance of joint 3 comes out negative")


def test_parameters_that_are_many_for_the_poses_are_said_and_how_many_poses_it_takes(
    tmp_path,
):
    (few,) = said(
        inspect_campaign(service_arm_folder(tmp_path / "made", 1), ROBOTS),
        "poses are few",
    )
    words = few.replace(",", "").replace(":", "").split(" ")
    parameters, effective, numbers = (
        int(words[place])
        for place in (5, words.index("about") + 1, words.index("by") + 1)
    )
    assert few.startswith("24 poses") and numbers == 72 and 9 <= effective < parameters
    assert int(few.split("Measure about ")[1].split(" ")[0]) > 48
