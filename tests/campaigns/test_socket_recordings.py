"""Recordings of a ball in printed sockets become rows of a campaign, and faulty files are
refused in one line."""

import numpy as np
import pytest
from support import refused

from elastocal.campaigns.socket_recordings import (
    Recording,
    describe_sockets,
    find_recordings,
    read_recording,
    tabulate_recordings,
)
from elastocal.io.documents import check_document


def write_file(folder, text="0.1,0.2\n0.3,0.4\n", name="hole_0.csv"):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(text)
    return path


def test_a_folder_of_places_becomes_a_session_for_each_place(tmp_path):
    write_file(tmp_path / "front")
    write_file(tmp_path / "front", "0.5,0.6\n", "hole_1.csv")
    write_file(tmp_path / "back", "0.7,0.8\n", "hole_1.csv")
    # Poses that the controller computed lie beside the joint angles.
    write_file(tmp_path / "back", "1,2,3,4,5,6,7\n", "hole_1_pose.csv")
    recordings = [read_recording(path) for path in find_recordings(tmp_path)]
    table = tabulate_recordings(recordings)
    assert table["session"].tolist() == [0, 1, 1, 1]
    assert table["pose"].tolist() == [0, 1, 2, 3]
    np.testing.assert_array_equal(table["q1"], [0.7, 0.1, 0.3, 0.5])
    assert table["feature"].tolist() == ["hole_1", "hole_0", "hole_0", "hole_1"]
    assert set(table["target"]) == {"ball"}


@pytest.mark.parametrize("sockets", [1, 2, 3])
def test_the_document_of_recordings_is_a_valid_campaign(sockets):
    recordings = [
        Recording("front", socket, np.zeros((2, 7))) for socket in range(sockets)
    ]
    document = describe_sockets("mine", "panda", recordings, "7DoF", 0.06)
    check_document(document, "campaign", "campaign.yaml")
    assert len(document["features"]) == sockets
    if sockets == 2:
        assert document["distances"][0]["distance_m"] == 0.06
    if sockets == 3:
        assert document["features"]["hole_2"]["position_m"] == [0.12, 0.0, 0.0]


@pytest.mark.parametrize(
    ("name", "text", "key", "phrases"),
    [
        ("socket.csv", "0,1\n", "name", ["'socket.csv'", "hole_0.csv"]),
        ("hole_0.csv", "0,1\n\n0,1,2\n", "line 3", ["3 angles", "2, as in"]),
        ("hole_0.csv", "q1,q2\n0,1\n", "line 1, joint 1", ["'q1'", "no header"]),
        ("hole_0.csv", "0;1\n", "line 1, joint 1", ["'0;1'", "separated by commas"]),
        ("hole_0.csv", "0,1\n0,nan\n", "line 2, joint 2", ["'nan'", "in rad"]),
        ("hole_0.csv", "90,1\n", "line 1, joint 1", ["90", "rad, not degrees"]),
    ],
)
def test_a_faulty_file_is_refused_in_one_line(tmp_path, name, text, key, phrases):
    path = write_file(tmp_path / "front", text, name)
    with refused(path, key, *phrases):
        read_recording(path)


def test_an_empty_file_is_refused(tmp_path):
    path = write_file(tmp_path / "front", "")
    with refused(path, "", "no line of joint angles", "joint angles in rad"):
        read_recording(path)


def test_a_folder_without_recordings_is_refused(tmp_path):
    with refused(tmp_path, "", "no file hole_*.csv", "hole_0.csv and hole_1.csv"):
        find_recordings(tmp_path)


def test_recordings_that_do_not_fit_together_are_refused():
    first = Recording("front", 0, np.zeros((2, 7)))
    with refused("front/hole_0.csv", "", "the same socket twice", "each socket once"):
        tabulate_recordings([first, first])
    other = Recording("front", 1, np.zeros((2, 6)))
    with refused("front/hole_1.csv", "", "6 angles in a line", "7, as in the first"):
        tabulate_recordings([first, other])
