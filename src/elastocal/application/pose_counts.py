"""How many poses a campaign needs, by one rule before and after the measuring."""

from __future__ import annotations

import math

from elastocal.diagnosis.settings import Settings


def count_needed_poses(poses: int, numbers: int, effective: float) -> int:
    """Count the poses that measure enough numbers for each effective parameter.

    Parameters
    ----------
    poses : number of poses to fit.
    numbers : numbers that they measure, repeats not counted.
    effective : effective number of the parameters that they determine.
    """
    needed = poses * Settings().numbers_a_parameter * effective / numbers
    return math.ceil(needed)


def warn_of_few_poses(
    poses: int, numbers: int, parameters: int, effective: float
) -> list[str]:
    """Return a warning if poses are too few for the parameters of the declared model.

    `parameters` is their number, the others are as in `count_needed_poses`.
    """
    needed_poses = count_needed_poses(poses, numbers, effective)
    if needed_poses <= poses:
        return []
    return [
        f"{poses} poses are few for {parameters} parameters, of which they determine "
        f"about {effective:.0f}, by {numbers} numbers: other poses will be off by more "
        f"than these. Measure about {needed_poses} poses to fit, or orientations too, "
        "or declare fewer errors"
    ]
