"""Blocks of the study's tables, made by the steps of the study from random experiments,
and regressors by pinocchio to compare with."""

import numpy as np
from support import PinocchioPoint, without_tool

from elastocal.study.equation_11 import identify_blocks, pair_blocks
from elastocal.study.metrics import make_validation_set
from elastocal.study.simulation import (
    Loading,
    RandomDesign,
    add_noise_to_blocks,
    draw_random_experiments,
    pack_experiments,
    simulate_blocks,
    split_data_sets,
    unpack_deflections,
    unpack_experiments,
)

PAPER = Loading(1000.0, (0.0, 0.5, 0.0), "base", "full_turn")
AT = ("end_effector", "measuring_point")
CONFIGURATIONS_OF_THE_TEST = 30
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")


def experiments_of(
    robot, sets=5, configurations=4, purpose="identification", key="kuka"
):
    """Draw blocks of the experiments table."""
    design = RandomDesign(robot.chain, robot.joint_limits, PAPER, key)
    blocks = split_data_sets(sets)
    return [
        pack_experiments(
            numbers,
            draw_random_experiments(design, 1, purpose, numbers, configurations),
        )
        for numbers in blocks
    ]


def as_read(blocks):
    """Yield blocks as they are read from a table, with the name of the point in every
    row."""
    for block in blocks:
        yield block | {
            "point": np.full(len(block["data_set"]), block["point"], dtype=object)
        }


def deflections_of(robot, experiments, noise=0.0, at="end_effector", key="kuka"):
    """Simulate the deflections of each measuring point, as lists of blocks."""
    blocks = as_read(simulate_blocks(experiments, robot, at))
    if noise:
        blocks = as_read(add_noise_to_blocks(blocks, key, 1, noise))
    blocks_of_points = {point.name: [] for point in robot.chain.points}
    for block in blocks:
        blocks_of_points[block["point"][0]].append(block)
    return blocks_of_points


def identified(robot, strategy, experiments, deflections, rows=6, at="end_effector"):
    """Identify compliances by a strategy, as one table."""
    needed = {name: deflections[name] for name in strategy.points}
    blocks = identify_blocks(
        pair_blocks(experiments, needed), robot.chain, strategy, rows, at
    )
    return joined(list(blocks))


def joined(blocks):
    """Join blocks of a table to one."""
    columns = {}
    for name in blocks[0]:
        columns[name] = np.concatenate([block[name] for block in blocks])
    return columns


def compliances(table, length):
    """Return the compliances of one length, ndarray (sets, 6)."""
    return np.column_stack([table[f"compliance_{j}"] for j in range(1, 7)])[
        table["length"] == length
    ]


def judge(robot, at="end_effector"):
    """Make the validation set of a robot."""
    experiments = experiments_of(robot, 1, CONFIGURATIONS_OF_THE_TEST, purpose="test")
    (deflections,) = deflections_of(robot, experiments, at=at)[
        robot.chain.end_effector.name
    ]
    return make_validation_set(
        robot, unpack_experiments(experiments[0]), unpack_deflections(deflections), at
    )


def pinocchio_regressors(chain, block, name, at="end_effector", rows=6):
    """Compute the columns J_j (J^T w)_j of equation 10 for each row of a block of
    experiments, ndarray (R, rows, n)."""
    angles = np.column_stack([block[f"q{j + 1}"] for j in range(chain.coordinates)])
    wrench = np.column_stack([block[component] for component in WRENCH])
    loaded = (
        without_tool(chain.end_effector) if at == "end_effector" else chain.point(name)
    )
    measured_point = PinocchioPoint(chain, chain.point(name))
    loaded_point = PinocchioPoint(chain, loaded)
    jacobian = np.array([measured_point.pose_and_jacobian(q)[2] for q in angles])
    torques = np.array(
        [
            loaded_point.pose_and_jacobian(q)[2].T @ force
            for q, force in zip(angles, wrench, strict=True)
        ]
    )
    return (jacobian * torques[:, None])[:, :rows]
