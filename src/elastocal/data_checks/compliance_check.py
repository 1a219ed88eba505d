"""Joint compliances that no robot has: negative, or many times off what its data sheet says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.data_checks.placement import IMPLAUSIBLE_M
from elastocal.fitting.displacement import joint_compliances

if TYPE_CHECKING:
    from elastocal.fitting.fit_result import Fit

# Compliances of a robot and those published for its make differ by up to two or so; five is a unit, a sign or another effect
# that was taken for a joint's.
MOST_OFF_NOMINAL = 5.0
# What is usual for a robot's size is itself known to a factor of five.
MOST_OFF_USUAL = 25.0
_RIGID = (
    "the robot file states no joint compliances: the joints are taken as rigid, and do not yield to the weights that it may"
    " state; load the robot and set compliance to identify, or state them"
)
# So many standard errors beyond what robots have are no chance.
_SURE = 2.0


def fitted_compliance_warnings(fitted: Fit) -> list[str]:
    """`compliance_warnings` of a fit; none where measurements are wrong by centimetres: compliances mean nothing there.

    Where they are not identified, nor known, that the joints are taken as rigid.
    """
    model = fitted.model
    if not model.identifies_compliance and not model.compliance_known:
        return [_RIGID]
    off = np.sqrt((fitted.residual[:, :3] ** 2).sum(axis=1).mean())
    if not model.identifies_compliance or off > IMPLAUSIBLE_M:
        return []
    deviations = np.sqrt(np.diag(fitted.covariance))[fitted.places_of("joint_compliance")]
    return compliance_warnings(
        joint_compliances(model, fitted.estimate), deviations, model.nominal_compliance, model.compliance_known
    )


def compliance_warnings(compliance: np.ndarray, std_error: np.ndarray, nominal: np.ndarray, known: bool = True) -> list[str]:
    """Name the identified joint compliances that are negative, or far off nominal either way.

    `compliance`, `std_error` (n,): identified, rad/(N m); standard error 0 where a compliance was not identified. `nominal`
    (n,): of the robot file. `known`: whether it states them; else they are usual ones. Returns one sentence with value and
    standard error of each, or none.
    """
    compliance, std_error, nominal = (1e6 * values for values in (compliance, std_error, nominal))
    most, word = (MOST_OFF_NOMINAL, "nominal") if known else (MOST_OFF_USUAL, "usual for such a robot")
    low, high = nominal / most, most * nominal
    beyond = np.maximum(low - compliance, compliance - high)
    named = []
    for j in np.flatnonzero((std_error > 0) & (beyond > 0)):
        off = f"negative, {word} {nominal[j]:.3g}" if compliance[j] < 0 else f"{compliance[j] / nominal[j]:.2g} times {word}"
        chance = "" if beyond[j] > _SURE * std_error[j] else ", perhaps by chance"
        named.append(f"joint {j + 1} {compliance[j]:.3g} ± {std_error[j]:.2g} ({off}{chance})")
    if not named:
        return []
    return [
        f"joint compliances beyond what robots have, in µrad/(N·m): {', '.join(named)};"
        " check the sign and the unit of the loads, and whether something else yields too"
    ]
