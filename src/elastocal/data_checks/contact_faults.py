"""Find faults of measurements against features: touches and lengths.

A fit with free geometry bends the robot until such measurements agree, whatever they are.
The nominal robot cannot be bent. Only frames, targets and features are therefore fitted
here, and the remaining misfit is compared with that of other interpretations of the file.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.campaign import group_equal_rows
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
from elastocal.data_checks.swapped_places import PlaceComparison, report_swapped
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import (
    build_declared_model,
    build_nominal_model,
    evaluate_conditions,
    predict,
    predict_channels,
)
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import separate_measurements

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign
    from elastocal.data_checks.hypotheses import Hypothesis
    from elastocal.fitting.least_squares import Fit

# Errors of a nominal robot, m and rad, as the standard deviation of its measurements.
_NOMINAL_ERROR = 0.01
# Measurements this far from the nominal robot are implausible, as for positions: five
# times more than geometric errors and deflections cause.
_LARGEST_MISFIT_M = 5 * IMPLAUSIBLE_M


def find_contact_faults(campaign: Campaign) -> list[Fault]:
    """Find another interpretation of the whole file, or else rows that name a wrong
    feature; at most one fault."""
    fitted = _fit_nominal(campaign)
    return _find_interpretation(campaign, fitted) or _find_swapped(campaign, fitted)


def _find_interpretation(campaign: Campaign, fitted: Fit) -> list[Fault]:
    """Find the interpretation of the file with which the nominal robot fits its
    measurements, or say that none does; `fitted` is the nominal robot by the file as it
    is written."""
    written_m = _compute_misfit(fitted)
    if written_m < IMPLAUSIBLE_M:
        return []
    hypotheses = _list_hypotheses(campaign)
    misfits_m = [
        _compute_misfit(_fit_nominal(hypothesis.apply(campaign)))
        for hypothesis in hypotheses
    ]
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


def _find_swapped(campaign: Campaign, fitted: Fit) -> list[Fault]:
    """Find a feature whose measurements often fit another one of its kind.

    Sockets alone have a sharper test, see `swapped_places`.
    """
    # Components of one measurement would be compared one by one.
    channels = campaign.measuring.channels
    if any(channel.component is not None for channel in channels):
        return []
    return report_swapped(_compare_features(campaign, fitted), campaign)


def _compare_features(campaign: Campaign, fitted: Fit) -> PlaceComparison:
    """Compare each measurement with its feature and the others of its kind that the
    nominal robot may touch."""
    measurements = campaign.measurements
    channels = campaign.measuring.channels
    assert measurements.channel is not None
    keys = np.column_stack([measurements.session, measurements.channel])
    first, place_index = group_equal_rows(keys)
    session, channel = keys[first].T
    distance = _compute_distances(campaign, fitted)[:, channel]
    kinds = np.array([channels[number].kind.name for number in channel])
    is_comparable = session == session[place_index][:, None]
    is_comparable &= kinds == kinds[place_index][:, None]
    is_comparable &= distance < IMPLAUSIBLE_M
    # A channel without a feature has no other of its kind, and is never reported.
    features = np.array([channels[number].feature or 0 for number in channel])
    places = np.column_stack([session, features])
    return PlaceComparison.of(place_index, places, distance, is_comparable)


def _compute_distances(campaign: Campaign, fitted: Fit) -> np.ndarray:
    """Distance of N measurements from the feature of each of C channels with the nominal
    robot, (N, C) array, m."""
    model = fitted.model
    estimate = fitted.estimate
    observations = separate_measurements(campaign.measurements)
    conditions = evaluate_conditions(model, estimate, observations.states)
    poses = predict(model, estimate, observations, conditions)
    distances = []
    for number in range(len(campaign.measuring.channels)):
        channel = np.full(len(observations), number)
        moved = replace(observations, channel=channel)
        residual = predict_channels(model, estimate, moved, *poses).residual
        distances.append(np.linalg.norm(residual[:, :3], axis=1))
    return np.stack(distances, axis=1)


def _compute_misfit(fitted: Fit) -> float:
    """Residual of the nominal robot, m, a trimmed RMS: a few wrong rows are no fault of
    all."""
    return compute_trimmed_rms(np.linalg.norm(fitted.residual[:, :3], axis=1))


def _fit_nominal(campaign: Campaign) -> Fit:
    """Fit frames, targets and features to the nominal robot; wrong rows lose weight."""
    noise = Noise(
        "declared", _NOMINAL_ERROR, _NOMINAL_ERROR, np.zeros(campaign.robot.joints)
    )
    model = build_nominal_model(build_declared_model(campaign))
    return fit_model(model, separate_measurements(campaign.measurements), noise)
