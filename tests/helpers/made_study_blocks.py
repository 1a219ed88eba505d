"""Blocks of the study's tables, made by its own steps from random experiments, and
regressors by pinocchio to judge them by."""

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
    """Blocks of the experiments table."""
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
    """Blocks as a table gives them back: the name of the point in every row."""
    for block in blocks:
        yield block | {
            "point": np.full(len(block["data_set"]), block["point"], dtype=object)
        }


def deflections_of(robot, experiments, noise=0.0, at="end_effector", key="kuka"):
    blocks = as_read(simulate_blocks(experiments, robot, at))
    if noise:
        blocks = as_read(add_noise_to_blocks(blocks, key, 1, noise))
    found = {point.name: [] for point in robot.chain.points}
    for block in blocks:
        found[block["point"][0]].append(block)
    return found


def identified(robot, strategy, experiments, deflections, rows=6, at="end_effector"):
    needed = {name: deflections[name] for name in strategy.points}
    blocks = identify_blocks(
        pair_blocks(experiments, needed), robot.chain, strategy, rows, at
    )
    return joined(list(blocks))


def joined(blocks):
    return {
        name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]
    }


def compliances(table, length):
    """(sets, 6) of one length."""
    return np.column_stack([table[f"compliance_{j}"] for j in range(1, 7)])[
        table["length"] == length
    ]


def judge(robot, at="end_effector"):
    experiments = experiments_of(robot, 1, CONFIGURATIONS_OF_THE_TEST, purpose="test")
    (seen,) = deflections_of(robot, experiments, at=at)[robot.chain.end_effector.name]
    return make_validation_set(
        robot, unpack_experiments(experiments[0]), unpack_deflections(seen), at
    )


def pinocchio_regressors(chain, block, name, at="end_effector", rows=6):
    """Columns J_j (J^T w)_j of equation 10 for each row of a block of experiments,
    ndarray (R, rows, n)."""
    angles = np.column_stack([block[f"q{j + 1}"] for j in range(chain.coordinates)])
    wrench = np.column_stack([block[component] for component in WRENCH])
    loaded = (
        without_tool(chain.end_effector) if at == "end_effector" else chain.point(name)
    )
    seen, pushed = (
        PinocchioPoint(chain, point) for point in (chain.point(name), loaded)
    )
    jacobian = np.array([seen.pose_and_jacobian(q)[2] for q in angles])
    torques = np.array(
        [
            pushed.pose_and_jacobian(q)[2].T @ force
            for q, force in zip(angles, wrench, strict=True)
        ]
    )
    return (jacobian * torques[:, None])[:, :rows]
