"""A ball that was in the other socket is named with its rows, and a robot with errors of
millimetres is not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_campaign
from elastocal.data_checks.faults import find_faults
from elastocal.data_checks.swapped_places import find_swapped_places

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def campaign():
    """The measured Panda whose ball was in two sockets at eight places."""
    folder = ROOT / "data" / "measured" / "panda_2_sockets"
    return read_campaign(read_campaign_folder(folder, ROOT / "config" / "robots"))


def swap(campaign, rows):
    """Name the other socket in these rows."""
    channel = campaign.measurements.channel.copy()
    channel[rows] = 1 - channel[rows]
    return replace(
        campaign, measurements=replace(campaign.measurements, channel=channel)
    )


def rows_of(campaign, session, channel):
    measurements = campaign.measurements
    return np.flatnonzero(
        (measurements.session == session) & (measurements.channel == channel)
    )


def test_measured_sockets_have_no_fault(campaign):
    assert find_faults(campaign) == ()


@pytest.mark.parametrize("session", [0, 4, 7])
def test_rows_of_the_other_socket_are_named(campaign, session):
    rows = rows_of(campaign, session, 0)[-4:]
    (fault,) = find_faults(swap(campaign, rows))
    assert fault.name == "swapped_places"
    first, last = campaign.measurements.row[rows[[0, -1]]]
    assert f"4 measurements of hole_1 in session {session}" in fault.detail
    assert f"(rows {first} to {last}) fit hole_0" in fault.detail
    before, after = fault.evidence
    assert before > 0.02 and after < before / 2


def test_a_single_row_is_left_to_the_diagnosis(campaign):
    rows = rows_of(campaign, 2, 1)[:1]
    assert find_swapped_places(swap(campaign, rows)) == []


def test_two_sockets_whose_names_are_exchanged_throughout_are_the_same_tool(campaign):
    rows = np.flatnonzero(campaign.measurements.session == 3)
    assert find_swapped_places(swap(campaign, rows)) == []
