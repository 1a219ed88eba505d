"""Public campaigns: a row for each reflector of each measurement, on an unloaded flange in a frame that nobody knows."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import pdist
from support import refused

from elastocal.campaigns.importers.reflectors import pose_and_repeat, reflector_table, unloaded_document, write_reflectors
from elastocal.campaigns.reading import read_campaign
from elastocal.effects.catalogue import effects

POSITIONS = {"left": np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), "right": -np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])}
ANGLES = np.array([[0.1, 0.2, 0.3], [-0.1, -0.2, -0.3]])


def test_the_reflectors_of_a_measurement_follow_each_other():
    table = reflector_table(np.array([5, 9]), np.array([0, 2]), ANGLES, POSITIONS)
    assert {name: values.tolist() for name, values in table.items()} == {
        "pose": [5, 5, 9, 9],
        "load": [0, 0, 0, 0],
        "repeat": [0, 0, 2, 2],
        "target": ["left", "right", "left", "right"],
        "q1": [0.1, 0.1, -0.1, -0.1],
        "q2": [0.2, 0.2, -0.2, -0.2],
        "q3": [0.3, 0.3, -0.3, -0.3],
        "x": [1.0, -1.0, 4.0, -4.0],
        "y": [2.0, -2.0, 5.0, -5.0],
        "z": [3.0, -3.0, 6.0, -6.0],
    }


def test_a_folder_of_reflectors_is_a_campaign_whose_equal_angles_are_repeats(config_folder, tmp_path):
    rng = np.random.default_rng(1)
    angles = rng.uniform(-0.5, 0.5, (8, 6))[[0, 1, 0, 2, 3, 4, 5, 6, 7]]
    positions = {name: rng.uniform(-1, 1, (9, 3)) for name in ("right", "left")}
    noise, holdout = {"position_m": 3e-5}, {"fraction": 0.25, "seed": 2}
    write_reflectors(tmp_path / "campaign", "made", "kuka", angles, positions, holdout, noise)
    campaign = read_campaign(tmp_path / "campaign", config_folder / "robots")
    assert (campaign.name, campaign.noise, campaign.holdout) == ("made", noise, holdout)
    assert [(target.name, target.point) for target in campaign.targets] == [("right", "6DoF"), ("left", "6DoF")]
    seen = campaign.measurements
    assert seen.pose.tolist() == np.repeat([0, 1, 0, 2, 3, 4, 5, 6, 7], 2).tolist()
    assert np.flatnonzero(seen.repeat).tolist() == [4, 5] and seen.repeat.max() == 1
    assert not seen.session.any() and not seen.load.any() and not seen.wrench.any()
    np.testing.assert_array_equal(seen.joint_angles, angles.repeat(2, axis=0))
    for index, name in enumerate(positions):
        np.testing.assert_array_equal(seen.position[seen.target == index], positions[name])


def test_a_declaration_that_no_campaign_may_have_is_refused_and_nothing_is_written(tmp_path):
    with refused((tmp_path / "campaign" / "campaign.yaml").as_posix(), "noise"):
        write_reflectors(tmp_path / "campaign", "made", "kuka", np.zeros((2, 6)), POSITIONS, noise={"position_mm": 0.03})
    assert not (tmp_path / "campaign").exists()


def test_targets_are_unknown_offsets_from_the_last_point_and_declared_effects_are_of_the_catalogue():
    document = unloaded_document("c", "kuka", "pose", ("A", "B"))
    assert document == {
        "campaign": "c",
        "robot": "kuka",
        "measured": "pose",
        "frame": "tracker",
        "targets": {name: {"point": "6DoF", "offset_m": "unknown"} for name in "AB"},
        "compliance": "nominal",
        "declared": ["joint_offset", "link_geometry"],
    }
    assert set(document["declared"]) <= set(effects())


def test_poses_are_numbered_as_they_first_come_and_repeats_as_they_follow():
    a, b, c = [0.1, 0.2], [0.3, -0.2], [-1.0, 2.0]
    pose, repeat = pose_and_repeat(np.array([c, a, c, b, a, c]))
    assert pose.tolist() == [0, 1, 0, 2, 1, 0]
    assert repeat.tolist() == [0, 0, 1, 0, 1, 2]
    assert pose.dtype == repeat.dtype == np.int32


@given(st.lists(st.tuples(st.integers(-6, 6), st.integers(-6, 6)), min_size=2, max_size=25))
@settings(max_examples=20)
def test_poses_are_the_single_linkage_clusters_of_scipy(rows):
    angles = np.array(rows, float)
    expected = fcluster(linkage(pdist(angles, "chebyshev"), "single"), 1.5, "distance")
    pose, repeat = pose_and_repeat(angles, 1.5)
    np.testing.assert_array_equal(pose[:, None] == pose, expected[:, None] == expected)
    assert list(dict.fromkeys(pose.tolist())) == list(range(pose.max() + 1))
    for number in range(pose.max() + 1):
        assert repeat[pose == number].tolist() == list(range((pose == number).sum()))
