"""Find faults of measurements against features: touches and lengths.

A fit with free geometry bends the robot until such measurements agree, whatever they are.
The nominal robot cannot be bent. Only frames, targets and features are therefore fitted
here, and the remaining misfit is compared with that of other interpretations of the file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.data_checks.hypotheses import (
    list_exchanged_joints,
    list_senses,
    list_units_of_values,
)
from elastocal.data_checks.placement import (
    FAR_BETTER,
    IMPLAUSIBLE_M,
    compute_trimmed_rms,
)
from elastocal.data_checks.protocol import Fault, Value
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import build_declared_model, build_nominal_model
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import separate_measurements

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign
    from elastocal.data_checks.hypotheses import Hypothesis

# Errors of a nominal robot, m and rad, as the standard deviation of its measurements.
_NOMINAL_ERROR = 0.01
# Measurements this far from the nominal robot are implausible, as for positions: five
# times more than geometric errors and deflections cause.
_LARGEST_MISFIT_M = 5 * IMPLAUSIBLE_M


def find_contact_faults(campaign: Campaign) -> list[Fault]:
    """Find the interpretation of the file with which the nominal robot fits its
    measurements, or say that none does; at most one fault."""
    written_m = _compute_misfit(campaign)
    if written_m < IMPLAUSIBLE_M:
        return []
    hypotheses = _list_hypotheses(campaign)
    misfits_m = [_compute_misfit(other.apply(campaign)) for other in hypotheses]
    best = int(np.argmin(misfits_m))
    if misfits_m[best] < min(IMPLAUSIBLE_M, written_m / FAR_BETTER):
        hypothesis = hypotheses[best]
        evidence = written_m, misfits_m[best]
        return [
            Fault(hypothesis.name, hypothesis.joints, hypothesis.detail, (), evidence)
        ]
    if written_m < _LARGEST_MISFIT_M:
        return []
    error = campaign.measuring.error
    detail = (
        f"the {error} is {written_m:.2g} m (RMS) with the robot file as it is, and no"
        " other sense, order or unit explains it: check the chain, the zeros and the"
        " order of the joints, and the features of each row"
    )
    parameters = (Value(f"RMS {error}", written_m, "m"),)
    evidence = written_m, written_m
    return [Fault("implausible_measurements", (), detail, parameters, evidence)]


def _list_hypotheses(campaign: Campaign) -> list[Hypothesis]:
    """List the interpretations that are tried, the simplest first."""
    joints = campaign.robot.commands
    hypotheses = [*list_senses(joints), *list_exchanged_joints(joints)]
    if any(kind.columns and not kind.touches for kind in campaign.measuring.kinds):
        hypotheses = [*list_units_of_values(), *hypotheses]
    return hypotheses


def _compute_misfit(campaign: Campaign) -> float:
    """Residual of the nominal robot, m, a trimmed RMS: a few wrong rows are no fault of
    all."""
    noise = Noise(
        "declared", _NOMINAL_ERROR, _NOMINAL_ERROR, np.zeros(campaign.robot.joints)
    )
    model = build_nominal_model(build_declared_model(campaign))
    fitted = fit_model(model, separate_measurements(campaign.measurements), noise)
    return compute_trimmed_rms(np.linalg.norm(fitted.residual[:, :3], axis=1))
