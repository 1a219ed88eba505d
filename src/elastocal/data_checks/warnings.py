"""What `check` warns of and no diagnosis stops at: joint compliances that no robot has, positions that a controller worked out.

Compliances that are negative or many times off their data sheet are an effect's, no fault of the data, and a controller's
positions show only that nothing is at fault.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.data_checks.placement import IMPLAUSIBLE_M, jacobians_at_targets, placed, rms
from elastocal.fitting.model import joint_compliances

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign
    from elastocal.fitting.least_squares import Fit

# Compliances of a robot and those published for its make differ by up to two or so; five is a unit, a sign or another effect
# that was taken for a joint's. What is usual for a robot's size is itself known to a factor of five.
MOST_OFF_NOMINAL, MOST_OFF_USUAL = 5.0, 25.0
_RIGID = (
    "the robot file states no joint compliances: the joints are taken as rigid, and do not yield to the weights that it may"
    " state; load the robot and set compliance to identify, or state them"
)
# So many standard errors beyond what robots have are no chance.
_SURE = 2.0
# Nobody writes more digits than this; lengths of a robot file have no more than micrometres.
_MOST_DIGITS, _DIGITS_OF_LENGTHS_M = 9, 1e-6
# By so much rounding may be exceeded by chance; where it is itself as large as this, it says nothing of the robot.
_BY_CHANCE, _TOO_COARSE_M, _FEWEST_POSES = 1.3, 1e-4, 6


def fitted_compliance_warnings(fitted: Fit) -> list[str]:
    """Name the identified joint compliances of a fit that are negative, or far off nominal either way, in one sentence.

    None where measurements are wrong by centimetres: compliances mean nothing there. Where they are neither identified nor
    known, that the joints are taken as rigid.
    """
    model = fitted.model
    if not model.identifies_compliance and not model.compliance_known:
        return [_RIGID]
    off = np.sqrt((fitted.residual[:, :3] ** 2).sum(axis=1).mean())
    if not model.identifies_compliance or off > IMPLAUSIBLE_M:
        return []
    std_error = np.sqrt(np.diag(fitted.covariance))[fitted.places_of("joint_compliance")]
    found = joint_compliances(model, fitted.estimate)
    return compliance_warnings(found, std_error, model.nominal_compliance, model.compliance_known)


def compliance_warnings(compliance: np.ndarray, std_error: np.ndarray, nominal: np.ndarray, known: bool = True) -> list[str]:
    """The same of compliances (n,) with standard errors, 0 where not identified, and those of the robot file, rad/(N m).

    `known`: whether the file states them; else they are usual ones.
    """
    compliance, std_error, nominal = (1e6 * values for values in (compliance, std_error, nominal))
    most, word = (MOST_OFF_NOMINAL, "nominal") if known else (MOST_OFF_USUAL, "usual for such a robot")
    beyond = np.maximum(nominal / most - compliance, compliance - most * nominal)
    named = []
    for j in np.flatnonzero((std_error > 0) & (beyond > 0)):
        off = f"negative, {word} {nominal[j]:.3g}" if compliance[j] < 0 else f"{compliance[j] / nominal[j]:.2g} times {word}"
        chance = "" if beyond[j] > _SURE * std_error[j] else ", perhaps by chance"
        named.append(f"joint {j + 1} {compliance[j]:.3g} ± {std_error[j]:.2g} ({off}{chance})")
    remedy = "check the sign and the unit of the loads, and whether something else yields too"
    return [f"joint compliances beyond what robots have, in µrad/(N·m): {', '.join(named)}; {remedy}"] if named else []


def controller_warnings(campaign: Campaign) -> list[str]:
    """Say where positions are those of the robot file's own kinematics, to the rounding of what is written, in every row.

    No robot goes where its nominal kinematics are to a few micrometres, and no instrument would show it.
    """
    measurements, robot, placement = campaign.measurements, campaign.robot, placed(campaign)
    reported = robot.reported_angles(measurements.joint_angles)
    step = max(_last_digit(reported), np.radians(_last_digit(np.degrees(reported))))
    jacobian = jacobians_at_targets(campaign, placement.estimate)
    # A number is off by a uniform error of its last digit.
    shown = max(_last_digit(measurements.position), _DIGITS_OF_LENGTHS_M)
    rounding = np.sqrt(((step * jacobian) ** 2).sum(axis=(1, 2)) + 3 * shown**2)
    expected, off = rms(rounding) / np.sqrt(12.0), placement.distance
    beyond = rms(off) > _BY_CHANCE * expected or (off > rounding * robot.joints).any()
    if len(np.unique(measurements.pose)) < _FEWEST_POSES or expected > _TOO_COARSE_M or beyond:
        return []
    return [
        f"positions are those of the robot file's own kinematics to {1e6 * max(rms(off), 1e-7):.2g} µm in every row, as a"
        " controller works them out of the joint angles: they are no measurements, and show nothing of the robot"
    ]


def _last_digit(values: np.ndarray) -> float:
    """Of numbers that were rounded the least step, such as 0.001; 0 where they have all digits."""
    for digits in range(_MOST_DIGITS):
        scaled = values * 10.0**digits
        if (np.abs(scaled - np.round(scaled)) <= 1e-6 + 1e-13 * np.abs(scaled)).all():
            return 10.0**-digits
    return 0.0
