import numpy as np
import pyarrow as pa

from elastocal.campaigns.tables import Cells
from elastocal.exchange.numbering import number_loads_and_repeats, number_poses

ANGLES = np.array([[0.0, 1.0], [0.5, 1.0], [0.0, 1.0 + 5e-4], [0.0, 1.01]])


def make_cells(**columns):
    encoded = {name: pa.chunked_array([values]) for name, values in columns.items()}
    return Cells("table", encoded, np.arange(1, 5))


def test_rows_within_a_milliradian_are_one_pose():
    pose = number_poses(make_cells(), ANGLES)["pose"]
    assert pose[0] == pose[2]
    assert len(set(pose)) == 3


def test_numbers_of_a_column_are_kept():
    table = number_poses(make_cells(pose=[7, 8, 7, 9], session=[0, 0, 1, 1]), ANGLES)
    np.testing.assert_array_equal(table["pose"], [7, 8, 7, 9])
    np.testing.assert_array_equal(table["session"], [0, 0, 1, 1])


def test_names_of_poses_are_counted():
    cells = make_cells(pose=["home", "left", "home", "up"])
    np.testing.assert_array_equal(number_poses(cells, ANGLES)["pose"], [1, 2, 1, 3])


def test_wrenches_of_a_pose_are_loads_and_equal_states_repeats():
    table = {
        "pose": np.ones(4, int),
        "target": np.array(["A"] * 4),
        "fx": np.array([0.0, 10.0, 20.0, 10.0]),
    }
    numbers = number_loads_and_repeats(make_cells(), table)
    np.testing.assert_array_equal(numbers["load"], [0, 1, 2, 1])
    np.testing.assert_array_equal(numbers["repeat"], [0, 0, 0, 1])
