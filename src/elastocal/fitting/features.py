"""Features of a campaign in a fit: their parameters, and predictions of all kinds.

A kind predicts its measurements in the frame of the session. Vectors and derivatives are
then rotated to base axes, in which the kinematic chain is differentiated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.effects.protocol import Parameter
from elastocal.measuring.catalogue import list_kinds
from elastocal.measuring.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.fitting.observations import Observations
    from elastocal.measuring.channels import Channel, MeasuringPlan
    from elastocal.measuring.protocol import Feature, Kind, Unknown


class SessionPoses(NamedTuple):
    """Predicted poses of targets in the frames of their sessions.

    Attributes
    ----------
    position : (M, 3) array, m.
    rotation : (M, 3, 3) array.
    frame : (M, 3, 3) array, rotation from base axes to the axes of the session.
    """

    position: np.ndarray
    rotation: np.ndarray
    frame: np.ndarray


@dataclass(frozen=True)
class FittedFeature:
    """A feature with unknowns that a fit estimates.

    Attributes
    ----------
    index : index of the feature in the plan
    feature, kind : the feature and its kind
    described : all unknowns of the feature
    numbers : indices of its fitted unknowns; exact ones are not fitted
    columns : slice of these unknowns among the fitted unknowns of all features
    """

    index: int
    feature: Feature
    kind: Kind
    described: tuple[Unknown, ...]
    numbers: list[int]
    columns: slice

    @property
    def unknowns(self) -> list[Unknown]:
        """The fitted unknowns."""
        return [self.described[number] for number in self.numbers]


def find_middle(
    plan: MeasuringPlan | None, features: Sequence[np.ndarray]
) -> np.ndarray | None:
    """Find the point (3,) m of the session about which all targets are.

    None if any feature of the plan, whose values are given, is touched in places that
    are apart from each other.
    """
    if plan is None or not features:
        return None
    middles = []
    for feature, values in zip(plan.features, features, strict=True):
        middle = list_kinds()[feature.kind].find_middle(values)
        if middle is None:
            return None
        middles.append(middle)
    return np.mean(middles, axis=0)


def list_fitted_features(plan: MeasuringPlan | None) -> list[FittedFeature]:
    """List the features of a plan that have fitted unknowns."""
    fitted: list[FittedFeature] = []
    start = 0
    for index, feature in enumerate(plan.features if plan else ()):
        kind = list_kinds()[feature.kind]
        described = kind.unknowns(feature)
        numbers = [
            number
            for number, unknown in enumerate(described)
            if unknown.prior_std != 0.0
        ]
        if numbers:
            columns = slice(start, start + len(numbers))
            entry = FittedFeature(index, feature, kind, described, numbers, columns)
            fitted.append(entry)
            start += len(numbers)
    return fitted


def list_feature_parameters(
    features: Sequence[FittedFeature],
) -> list[tuple[str, Parameter]]:
    """List the fitted parameters of features with their owners, such as "feature A"."""
    parameters = []
    for entry in features:
        owner = f"feature {entry.feature.name}"
        for unknown in entry.unknowns:
            parameter = Parameter(
                unknown.name,
                unknown.unit,
                unknown.plausible,
                prior_std=unknown.prior_std,
            )
            parameters.append((owner, parameter))
    return parameters


def get_feature_deviations(
    features: Sequence[FittedFeature], values: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Deviations of fitted unknowns from their declared values, one array a feature."""
    return [
        entry.kind.deviate(entry.feature, values[entry.index])[entry.numbers]
        for entry in features
    ]


def state_features(
    features: Sequence[FittedFeature], values: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Absolute values of fitted unknowns, one array a feature."""
    return [entry.kind.state(values[entry.index])[entry.numbers] for entry in features]


def move_features(
    features: Sequence[FittedFeature],
    values: Sequence[np.ndarray],
    components: Iterator[np.ndarray],
) -> tuple[np.ndarray, ...]:
    """Move the values of features by the next components of a step."""
    moved = list(values)
    for entry in features:
        step = np.zeros(len(entry.described))
        step[entry.numbers] = next(components)
        moved[entry.index] = entry.kind.move(values[entry.index], step)
    return tuple(moved)


def evaluate_channels(
    plan: MeasuringPlan,
    features: Sequence[FittedFeature],
    observations: Observations,
    poses: SessionPoses,
    values: Sequence[np.ndarray],
) -> Prediction:
    """Evaluate the kinds of M observations.

    Parameters
    ----------
    plan : MeasuringPlan
    features : fitted features of the plan
    observations : Observations
    poses : predicted poses of their targets
    values : values of each feature

    Returns
    -------
    Prediction
        Vectors, and derivatives in the pose, are in base axes. The unknowns are the
        fitted ones of all features.
    """
    assert observations.channel is not None
    fitted = {entry.index: entry for entry in features}
    unknown_count = sum(len(entry.numbers) for entry in fitted.values())
    numbers = gather_numbers(observations, plan)
    count = len(observations)
    residual = np.zeros((count, plan.rows))
    by_pose = np.zeros((count, plan.rows, 6))
    by_unknowns = np.zeros((count, plan.rows, unknown_count))
    for number in np.unique(observations.channel).tolist():
        channel = plan.channels[number]
        members = np.flatnonzero(observations.channel == number)
        predicted = _evaluate_channel(
            channel,
            SessionPoses(*(array[members] for array in poses)),
            numbers[members],
            np.zeros(0) if channel.feature is None else values[channel.feature],
        )
        residual[members] = predicted.residual
        by_pose[members] = predicted.by_pose
        entry = None if channel.feature is None else fitted.get(channel.feature)
        if entry is not None:
            of_feature = predicted.by_unknowns[..., entry.numbers]
            by_unknowns[members, :, entry.columns] = of_feature
    # Derivatives are taken in the axes of the session; the chain moves in base axes.
    halves = [by_pose[..., :3] @ poses.frame, by_pose[..., 3:] @ poses.frame]
    by_pose = np.concatenate(halves, axis=2)
    if plan.rows == 1:
        return Prediction(residual, by_pose, by_unknowns)
    return Prediction(
        _turn_rows(residual[..., None], poses.frame)[..., 0],
        _turn_rows(by_pose, poses.frame),
        _turn_rows(by_unknowns, poses.frame),
    )


def _evaluate_channel(
    channel: Channel, poses: SessionPoses, numbers: np.ndarray, values: np.ndarray
) -> Prediction:
    """Evaluate the measurements of one channel in the axes of the session."""
    predicted = channel.kind.evaluate(poses.position, poses.rotation, numbers, values)
    if channel.component is None:
        return predicted
    row = slice(channel.component, channel.component + 1)
    return Prediction(
        predicted.residual[:, row],
        predicted.by_pose[:, row],
        predicted.by_unknowns[:, row],
    )


def gather_numbers(observations: Observations, plan: MeasuringPlan) -> np.ndarray:
    """Gather the numbers (M, 6) of observations, m and rad, as their kinds expect them.

    If an observation is one component of a vector, its number moves to the column of
    this component.
    """
    numbers = np.zeros((len(observations), 6))
    width = observations.position.shape[1]
    numbers[:, :width] = observations.position
    if observations.rotation is not None:
        numbers[:, 3:] = Rotation.from_matrix(observations.rotation).as_rotvec()
    for number, channel in enumerate(plan.channels):
        component = channel.component
        if component is not None and 0 < component < 3:
            members = observations.channel == number
            numbers[members, component] = numbers[members, 0]
    return numbers


def _turn_rows(rows: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Turn vectors in the rows (M, 3 or 6, k) from axes of sessions to base axes."""
    vectors = rows.reshape(len(rows), -1, 3, rows.shape[2])
    return (frame.transpose(0, 2, 1)[:, None] @ vectors).reshape(rows.shape)
