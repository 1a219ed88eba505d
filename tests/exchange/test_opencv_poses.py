"""Arrays of OpenCV give poses of the board, and no pickle is loaded."""

import pickle

import numpy as np
import pytest
from made_boards import make_board_poses
from scipy.spatial.transform import Rotation
from support import refused

from elastocal.exchange.opencv_poses import read_opencv_poses

ANGLES, ROTATION, POSITION = make_board_poses(4)
VECTORS = Rotation.from_matrix(ROTATION).as_rotvec()


@pytest.mark.parametrize(
    "arrays",
    [
        # cv2.calibrateCamera returns columns.
        {"rvecs": VECTORS[..., None], "tvecs": POSITION[..., None]},
        {"R_target2cam": ROTATION, "t_target2cam": POSITION, "mtx": np.eye(3)},
    ],
)
def test_vectors_and_matrices_are_read(arrays, tmp_path):
    path = tmp_path / "calib.npz"
    np.savez(path, **arrays, joint_angles=ANGLES)
    poses = read_opencv_poses(path)
    np.testing.assert_allclose(poses.rotation, ROTATION, atol=1e-12)
    np.testing.assert_array_equal(poses.position, POSITION)
    np.testing.assert_array_equal(poses.angles, ANGLES)


@pytest.mark.parametrize(
    ("arrays", "key", "phrases"),
    [
        ({"rvecs": VECTORS}, "", ["arrays rvecs", "no tvecs or tvec"]),
        (
            {"rvecs": VECTORS[:2], "tvecs": POSITION},
            "rvecs",
            ["6 numbers", "4 positions"],
        ),
        (
            {"rvecs": VECTORS, "tvecs": POSITION, "q": ANGLES[:2]},
            "",
            ["(2, 7)", "4 rows"],
        ),
        ({"rvecs": VECTORS, "tvecs": np.array(4 * ["a"])}, "tvecs", ["no numbers"]),
    ],
)
def test_missing_and_unequal_arrays_are_refused(arrays, key, phrases, tmp_path):
    path = tmp_path / "calib.npz"
    np.savez(path, **arrays)
    with refused(path, key, *phrases):
        read_opencv_poses(path)


def test_a_pickle_is_never_loaded(tmp_path):
    path = tmp_path / "calib.npz"
    np.savez(path, rvecs=np.array([{"a": 1}], object), tvecs=POSITION)
    with refused(path, "", "no arrays", "allow_pickle"):
        read_opencv_poses(path)
    path.write_bytes(pickle.dumps({"rvecs": VECTORS}))
    with refused(path, "", "no arrays"):
        read_opencv_poses(path)
