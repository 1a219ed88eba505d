"""What would make a planned robot more accurate: further reflectors, orientations, or
more poses, at the chosen configurations."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.planning.designs import add_prior, compute_mean_gram
from elastocal.application.planning.survey import (
    compute_accuracy_rows,
    compute_information_rows,
)
from elastocal.campaigns.campaign import Target
from elastocal.measuring.pose import POSE

if TYPE_CHECKING:
    from elastocal.application.planning.plan import Candidates
    from elastocal.application.planning.survey import Survey

# Distance of further reflectors from the first one, on a bracket of usual size.
_APART_M = 0.1
# Prior standard deviation of an offset that is fitted.
_UNKNOWN_OFFSET_M = 0.1


def compare_improvements(
    survey: Survey, fitted: Candidates, workspace: Candidates
) -> dict[str, float]:
    """Compute the accuracy of a plan, with the key "", and with one change each.

    Parameters
    ----------
    survey : what is measured.
    fitted : configurations of the plan.
    workspace : configurations at which the robot shall be accurate.

    Returns
    -------
    RMS errors, m, by the change in words; all defined as that of the plan.
    """
    changes = {"": (survey, 1)}
    names = {target.name for target in survey.targets}
    end_effector = survey.robot.chain.end_effector.name
    on_end = [target for target in survey.targets if target.point == end_effector]
    if survey.setup is None and len(on_end) == 1:
        targets = (*survey.targets, *_add_reflectors(on_end[0], names))
        bracket = f"three reflectors on {end_effector}, {_APART_M:g} m apart"
        changes[bracket] = (replace(survey, targets=targets), 1)
    if survey.measured == "position":
        measured = replace(
            survey, measured="pose", orientation_rad=POSE.sensor.orientation_rad
        )
        changes["orientations beside positions"] = (measured, 1)
    changes["twice as many poses"] = (survey, 2)
    return {
        change: _compute_accuracy(changed, survey, fitted, workspace, copies)
        for change, (changed, copies) in changes.items()
    }


def _add_reflectors(target: Target, names: set[str]) -> list[Target]:
    """Make two further reflectors along two axes of a target's frame, whose offsets are as
    uncertain as its own."""
    std = _UNKNOWN_OFFSET_M if target.offset_m is None else target.offset_std_m
    reflectors = []
    for axis in range(2):
        offset = np.array(target.offset_m or (0.0, 0.0, 0.0))
        offset[axis] += _APART_M
        name = f"{target.name}+{axis + 1}"
        while name in names:
            name += "+"
        reflectors.append(
            Target(name, target.point, tuple(offset.tolist()), offset_std_m=std)
        )
    return reflectors


def _compute_accuracy(
    changed: Survey,
    survey: Survey,
    fitted: Candidates,
    workspace: Candidates,
    copies: int,
) -> float:
    """Compute the accuracy of a changed survey, as `survey` states it, m."""
    rows = compute_information_rows(
        changed, fitted.joint_angles, fitted.force, fitted.place_index
    )
    flat = rows.reshape(-1, rows.shape[2])
    information = add_prior(copies * (flat.T @ flat))
    accuracy_rows = compute_accuracy_rows(
        changed,
        workspace.joint_angles,
        workspace.force,
        offset_removed=survey.offset_removed,
    )
    weight = compute_mean_gram(accuracy_rows)
    return float(np.sqrt(np.trace(np.linalg.solve(information, weight))))
