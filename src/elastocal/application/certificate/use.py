"""The poses and loads that a robot is used at, as a certificate judges them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.calibrated import OperatingConditions
from elastocal.application.compensation import find_joint_targets
from elastocal.exchange.target_path import OK
from elastocal.validation.fitted_range import beyond_campaign

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.exchange.target_path import TargetPath
    from elastocal.fitting.observations import States


@dataclass(frozen=True)
class Use:
    """Commands (N, n) with their conditions, and which of them lie beyond what was fitted (N,)."""

    reported_angles: np.ndarray
    operating: OperatingConditions
    outside: np.ndarray


def use_at(calibrated: CalibratedRobot, fitted: States, wanted: TargetPath) -> Use:
    """The use of a robot at wanted poses, each corrected; a pose that it cannot reach lies beyond."""
    operating = OperatingConditions(wanted.wrench, wanted.approach, wanted.time_s, wanted.temperature_c)
    found = find_joint_targets(calibrated, wanted.position, wanted.rotation, operating, wanted.start)
    angles = calibrated.robot.model_angles(found.joint_angles)
    return Use(found.joint_angles, operating, beyond_campaign(fitted, angles, wanted.wrench) | (found.status != OK))
