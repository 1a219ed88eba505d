"""The Motoman's right arm as a campaign: made-up measurements in the files' own format come back as those of the chain."""

import numpy as np
import pytest
import scipy.io
from support import refused

from elastocal.campaigns.importers import motoman
from elastocal.campaigns.reading import read_campaign

POSES = 9


def rows(poses=POSES, images=3, seed=1):
    """Rows of a file, several images of each pose in no order."""
    draws = np.random.default_rng(seed)
    each = draws.uniform(-0.5, 0.5, (poses, 26))
    each[:, 0], each[:, 6] = np.arange(1, poses + 1), 1e-4
    return draws.permutation(np.repeat(each, images, axis=0))


def write_mat(path, values, name="dataset"):
    scipy.io.savemat(path, {name: values})
    return path


def test_each_pose_counts_once_and_those_that_nobody_saw_not_at_all(tmp_path, config_folder):
    values = rows()
    values[values[:, 0] == 4, 19:] = np.nan
    path = write_mat(tmp_path / "some.mat", values)
    angles, positions = motoman.read(path)
    position = positions[motoman.TARGET]
    assert len(angles) == POSES - 1
    first = values[np.unique(values[:, 0], return_index=True)[1]]
    first = first[first[:, 0] != 4]
    np.testing.assert_array_equal(angles, first[:, 7:13])
    np.testing.assert_array_equal(position, first[:, 19:22])
    motoman.write_campaign(path, tmp_path / "campaign", "made", {"fraction": 0.3, "seed": 1})
    campaign = read_campaign(tmp_path / "campaign", config_folder / "robots")
    np.testing.assert_allclose(campaign.measurements.position, position)
    np.testing.assert_allclose(campaign.measurements.joint_angles, angles)
    assert campaign.frame == "tracker" and campaign.noise == motoman.NOISE


def test_the_pose_that_the_source_itself_leaves_out_is_left_out(tmp_path):
    angles, _ = motoman.read(write_mat(tmp_path / "all.mat", rows(587, images=1)))
    kept = rows(587, images=1)
    kept = kept[np.argsort(kept[:, 0])]
    np.testing.assert_array_equal(angles, np.delete(kept, 12, axis=0)[:, 7:13])


def turn(values):
    values[:, 6] = 0.5
    return values


@pytest.mark.parametrize(
    ("values", "key"),
    [
        (rows()[:, :20], "dataset: found shape"),
        (turn(rows()), "a turntable at 0.5 rad"),
        (np.full((4, 26), np.nan), "no pose with angles and a position"),
    ],
)
def test_what_is_wrong_is_refused_in_one_line(tmp_path, values, key):
    path = write_mat(tmp_path / "wrong.mat", values)
    with refused(path, key):
        motoman.read(path)
