"""How many poses a campaign needs, by one rule before and after the measuring."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from elastocal.diagnosis.settings import Settings
from elastocal.measuring.position import POSITION

if TYPE_CHECKING:
    from collections.abc import Collection


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
    poses: int, numbers: int, parameters: int, effective: float, kinds: Collection[str]
) -> list[str]:
    """Return a warning if poses are too few for the parameters of the declared model.

    Parameters
    ----------
    poses, numbers, effective : as in `count_needed_poses`.
    parameters : number of parameters of the declared model.
    kinds : names of the kinds of measurements. Only a tracker that measures positions
        can measure orientations too: a board has them, and a contact has none.
    """
    needed_poses = count_needed_poses(poses, numbers, effective)
    if needed_poses <= poses:
        return []
    orientations = ", or orientations too" if set(kinds) == {POSITION.name} else ""
    return [
        f"{poses} poses are few for {parameters} parameters, of which they determine "
        f"about {effective:.0f}, by {numbers} numbers: errors at other poses will be larger "
        f"than at these. Measure about {needed_poses} poses to fit{orientations}, or declare "
        "fewer errors"
    ]
