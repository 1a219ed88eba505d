"""Robots that miss their poses by something smooth that no model of theirs has, and
inputs of a regression to find it."""

import numpy as np
from made_folders import make_folder, make_table

from elastocal.campaigns.simulation import Plan
from elastocal.loop.whole import read_cases
from elastocal.residual_model.regressions import Inputs

NOISE_M = 2e-5
SMOOTH_M = 4e-4


def smooth(joint_angles):
    """What a robot misses by, (N, 3), m: two trends over the workspace."""
    first = joint_angles[:, 0]
    second = joint_angles[:, 1]
    return SMOOTH_M * np.column_stack(
        [np.sin(first), np.cos(second), np.sin(first) * np.cos(second)]
    )


def made_inputs(count, seed, width=1.5, joints=2):
    """Inputs whose residuals are `smooth`, with noise."""
    draws = np.random.default_rng(seed)
    angles = draws.uniform(-width, width, (count, joints))
    inputs = Inputs(
        angles, np.zeros((count, 3)), draws.normal(0.0, 1.0, (count, 3, joints + 1))
    )
    return inputs, smooth(angles) + draws.normal(0.0, NOISE_M, (count, 3))


def smoothly_wrong_folder(
    folder, robot, name="smooth", poses=60, seed=1, offset_m=(0, 0, 0), **changes
):
    """A campaign's folder of an unloaded robot that misses its poses by `smooth`."""
    plan = Plan(("6DoF",), poses, 100.0, (0,), (0.0, 0.0, 0.0), 1, 0, NOISE_M, NOISE_M)
    table = make_table(robot, name, seed, plan)
    off = smooth(
        np.column_stack([table[f"q{joint}"] for joint in range(1, robot.joints + 1)])
    )
    for axis, values in zip("xyz", off.T, strict=True):
        table[axis] = table[axis] + values
    targets = {
        "6DoF": {
            "point": "6DoF",
            "offset_m": offset_m if isinstance(offset_m, str) else list(offset_m),
        }
    }
    changes = {
        "targets": targets,
        "compliance": "nominal",
        "noise": {"position_m": NOISE_M},
    } | changes
    return make_folder(folder, robot, name, table=table, **changes)


def smoothly_wrong_cases(folder, robot, robots_folder, **changes):
    """Training and held-out cases of such a folder."""
    return read_cases(smoothly_wrong_folder(folder, robot, **changes), robots_folder)
