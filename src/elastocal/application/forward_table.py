"""The forward model as a table for programs that cannot run it: what a robot misses, at angles spread over its joint space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.interpolate import RBFInterpolator
from scipy.spatial.transform import Rotation

from elastocal.application.accuracy import root_mean_square
from elastocal.application.calibrated import forward, nominal_forward

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot, OperatingConditions

# Rows in whose neighbourhood the error of interpolation is measured, and of how many neighbours one interpolates.
_TRIED, _NEIGHBOURS = 256, 60
_POSE = ("x", "y", "z", "rx", "ry", "rz")
_ERRORS = tuple(f"d{name}" for name in _POSE)


def forward_table(calibrated: CalibratedRobot, rows: int, operating: OperatingConditions, seed: int) -> pd.DataFrame:
    """Nominal poses and errors of a robot over its joint limits.

    `rows`: about so many: the next power of two, at points of a scrambled Sobol sequence [1]. `operating`: one row, for all.
    Returns ``q1..qn`` (rad, as the controller reports them), ``x..rz`` (m, rotation vector in rad: where the robot file has the
    end effector, base axes), ``dx..drz``: where it is less where the file has it, displacement and rotation vector.

    [1] Owen, A. B., Scrambling Sobol' and Niederreiter-Xing points, Journal of Complexity 14, 1998.
    """
    from scipy.stats import qmc

    low, high = calibrated.robot.joint_limits.T
    points = qmc.Sobol(len(low), rng=np.random.default_rng(seed)).random_base2(int(np.ceil(np.log2(max(rows, 2)))))
    return _tabulate(calibrated, calibrated.robot.reported_angles(low + points * (high - low)), operating)


def interpolation_error_m(
    calibrated: CalibratedRobot, table: pd.DataFrame, operating: OperatingConditions, seed: int
) -> tuple[float, float]:
    """By how much interpolation in a table misses the displacement of the model.

    By thin plate splines of the nearest rows, in angles over their range [1], at fresh random angles.

    `calibrated`, `operating`: as in `forward_table`. Returns `interpolated`, `nothing`: RMS position error of the
    interpolation, and of no correction at all, m.

    [1] Fasshauer, G. E., Meshfree Approximation Methods with MATLAB, World Scientific, 2007.
    """
    low, high = calibrated.robot.joint_limits.T
    angles = calibrated.robot.reported_angles(np.random.default_rng(seed).uniform(low, high, (_TRIED, len(low))))
    known = table[[f"q{joint}" for joint in range(1, len(low) + 1)]].to_numpy()
    scale = np.ptp(known, axis=0)
    errors = list(_ERRORS[:3])
    spline = RBFInterpolator(known / scale, table[errors].to_numpy(), min(_NEIGHBOURS, len(known)))
    true = _tabulate(calibrated, angles, operating)[errors].to_numpy()
    return root_mean_square(spline(angles / scale) - true), root_mean_square(true)


def _tabulate(calibrated: CalibratedRobot, reported: np.ndarray, operating: OperatingConditions) -> pd.DataFrame:
    there, turned = forward(calibrated, reported, operating)
    position, rotation = nominal_forward(calibrated.robot, reported)
    angles = {f"q{joint}": column for joint, column in enumerate(reported.T, 1)}
    nominal = np.hstack([position, Rotation.from_matrix(rotation).as_rotvec()])
    turn = Rotation.from_matrix(turned @ rotation.transpose(0, 2, 1)).as_rotvec()
    columns = dict(zip((*_POSE, *_ERRORS), np.hstack([nominal, there - position, turn]).T, strict=True))
    return pd.DataFrame(angles | columns)
