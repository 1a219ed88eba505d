"""Arrays to columns of tables and back."""

import numpy as np
from support import OTHER_CHAINS, random_loads, robot_of

from elastocal.study.steps.columns import (
    block_shape,
    data_sets,
    deflection_columns,
    experiment_columns,
    index_columns,
    to_deflections,
    to_experiments,
)
from elastocal.study.table_schemas import DEFLECTIONS, experiments


def test_rows_are_numbered_by_data_set_and_configuration():
    columns = index_columns([4, 7], 3)
    assert columns["data_set"].tolist() == [4, 4, 4, 7, 7, 7]
    assert columns["configuration"].tolist() == [0, 1, 2, 0, 1, 2]
    assert block_shape(columns) == (2, 3)
    assert data_sets(columns).tolist() == [4, 7] and data_sets(index_columns([0, 1], 1)).tolist() == [0, 1]


def test_experiments_come_back_as_they_were():
    for text in OTHER_CHAINS.values():
        robot = robot_of(text)
        loads = random_loads(robot, 2, 3)
        columns = experiment_columns([0, 1], loads)
        assert set(columns) == {column.name for column in experiments(robot.joints).columns}
        back = to_experiments(columns)
        np.testing.assert_array_equal(back.joint_angles, loads.joint_angles)
        np.testing.assert_array_equal(back.wrench, loads.wrench)


def test_deflections_come_back_as_they_were():
    deflections = np.random.default_rng(1).standard_normal((2, 3, 6))
    columns = deflection_columns("3DoF", [0, 1], deflections)
    assert set(columns) == {column.name for column in DEFLECTIONS.columns} and columns["point"] == "3DoF"
    assert columns["dy"][4] == deflections[1, 1, 1] and columns["rz"][2] == deflections[0, 2, 5]
    np.testing.assert_array_equal(to_deflections(columns), deflections)
