"""Other interpretations of a file: hypotheses, compared by how well the data then fit.

The hypotheses concern senses, axes, units, order of rows, frames and targets. They are
tested if the measurements as written are absurdly far from the nominal robot; the
simplest one that explains the measurements is reported. Senses, axes and units are
discrete: each is tested, none is fitted. The placement of base or targets is fitted, and
must then fit far better.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, permutations, product
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy  # Import its optimizers lazily: few campaigns need them.
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import group_equal_rows
from elastocal.data_checks.placement import (
    FAR_BETTER,
    IMPLAUSIBLE_M,
    IMPLAUSIBLE_RAD,
    place_measurements,
    place_robustly,
    root_mean_square,
    select_spread_poses,
)
from elastocal.data_checks.protocol import Fault, Value
from elastocal.measuring.board import ON_ROBOT

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.data_checks.placement import Placement

_IMPLAUSIBLE = np.array([IMPLAUSIBLE_M, IMPLAUSIBLE_RAD])
# Number of poses that suffices to compare some two hundred hypotheses.
_POSES = 40
# A residual that a correction does not concern may become this much larger by chance.
_NO_WORSE = 1.2
# Hypotheses are equivalent if their misfits differ by less than this factor, or by less
# than a tracker resolves; so many of them are reported.
_EQUIVALENT_RATIO = 1.1
_EQUIVALENT_M = 1e-4
_MAX_ALTERNATIVES = 5
# A base that is misplaced by less may be the zero of the first joint or the height of the
# column, and a target the length of the last link: the diagnosis decides that. Ten times
# the largest geometric errors of industrial robots.
_NEAR_M = 0.05
_NEAR_RAD = 0.05
# Logarithms of the factors by which the size of a board may be wrong; the misfit from
# which such a factor is looked for: twice what a nominal robot leaves at the least.
_LOG_SCALES = (-1.6, 1.6)
_SCALED_M = 0.005
# Factor by which the right scale must lower the misfit. Both misfits have the errors of
# the nominal robot, millimetres, so that no more can be asked: on the FR3 of
# data/measured, factors from 1.1 on pass, and the data as they are give 0.997.
_SCALE_BETTER = 2.0
# A smaller factor is the length of a robot that differs from its file, or a print that
# shrank: the diagnosis decides that.
_NEAR_SCALE = 0.03
# Metres for each unit that people write instead of metres.
_LENGTHS = {
    "millimetres": 1e-3,
    "centimetres": 1e-2,
    "decimetres": 0.1,
    "inches": 0.0254,
    "feet": 0.3048,
    "tenths of what they should be": 10.0,
    "hundredths of what they should be": 100.0,
    "thousandths of what they should be": 1e3,
}
# Axes of the optical frame of a camera in its link frame, as ROS has them (REP 103), and
# the other way round.
_LINK_TO_OPTICAL = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
_CAMERA_AXES = (_LINK_TO_OPTICAL, _LINK_TO_OPTICAL.T)
# Angles that people write instead of a rotation vector, by scipy's letters: capital ones
# rotate about the moved axes.
_EULER = {
    "XYZ": "Euler angles about the moved x, y, z",
    "xyz": "angles about the fixed x, y, z (roll, pitch, yaw)",
}


@dataclass(frozen=True)
class Hypothesis:
    """Another interpretation of the file.

    Attributes
    ----------
    name : str
        Of the fault that it would be.
    detail : str
        One plain sentence.
    apply : function
        Returns the campaign in this interpretation.
    joints : tuple of int
        Counted from 1.
    describe : function or None
        If the interpretation is fitted, returns the sentence for the placements as
        written and as reinterpreted, or None if the misplacement is small enough to be
        left to the diagnosis.
    """

    name: str
    detail: str
    apply: Callable[[Campaign], Campaign]
    joints: tuple[int, ...] = ()
    describe: Callable[[Placement, Placement], str | None] | None = None


def find_better_interpretation(campaign: Campaign) -> list[Fault]:
    """Find the simplest interpretation of the file that lets absurd measurements fit.

    Equivalent interpretations are its alternatives. Returns at most one fault.
    """
    subset = select_spread_poses(campaign, _POSES)
    scale_faults = _find_wrong_scale(subset)
    if scale_faults:
        return scale_faults
    row_shifts = list_row_shifts(campaign)
    faults = _test_hypotheses(
        subset,
        [*list_discrete_hypotheses(subset), *row_shifts],
        list_fitted_hypotheses(subset),
    )
    loaded = campaign.measurements.load > 0
    if faults or not loaded.any():
        return faults
    # If rows are shifted by one within each pose, only the last load shows it, because
    # it has the measurement of the next pose.
    measurements = campaign.measurements.select(loaded)
    subset = select_spread_poses(replace(campaign, measurements=measurements), _POSES)
    return _test_hypotheses(subset, row_shifts)


def _test_hypotheses(campaign: Campaign, *groups: Sequence[Hypothesis]) -> list[Fault]:
    """Fault of the best hypothesis of the first group that has one, unless the best of
    the next group is far better."""
    written = place_robustly(campaign)
    if (written.misfit <= _IMPLAUSIBLE).all():
        return []
    results = [_find_best(campaign, written, group) for group in groups if group]
    convincing = [result for result in results if result]
    if len(convincing) > 1 and convincing[1][0] >= convincing[0][0] / FAR_BETTER:
        convincing.pop()
    return [fault for _, fault in convincing[-1:] if fault]


def _find_best(
    campaign: Campaign, written: Placement, hypotheses: Sequence[Hypothesis]
) -> tuple[float, Fault | None] | None:
    """Find the first of the hypotheses that fit best.

    Returns its misfit, m, and its fault, if it is one; None if it does not convince.
    """
    misfits = np.array(
        [
            _combine_misfit(place_measurements(hypothesis.apply(campaign)).misfit)
            for hypothesis in hypotheses
        ]
    )
    limit = max(_EQUIVALENT_RATIO * misfits.min(), misfits.min() + _EQUIVALENT_M)
    best, *equivalent = (
        hypotheses[int(number)] for number in np.flatnonzero(misfits <= limit)
    )
    placement = place_robustly(best.apply(campaign))
    evidence = _compare_misfits(written, placement)
    if evidence is None:
        return None
    misfit = _combine_misfit(placement.misfit)
    detail = best.describe(written, placement) if best.describe else best.detail
    if not detail:
        return misfit, None
    poses = len(np.unique(placement.observations.states.pose))
    parameters = (Value("poses compared", float(poses), "–"),)
    alternatives = tuple(
        hypothesis.detail for hypothesis in equivalent[:_MAX_ALTERNATIVES]
    )
    return misfit, Fault(
        best.name, best.joints, detail, parameters, evidence, alternatives
    )


def _combine_misfit(misfit: np.ndarray) -> float:
    """Residual of positions and orientations together, m."""
    return float(np.hypot(misfit[0], IMPLAUSIBLE_M / IMPLAUSIBLE_RAD * misfit[1]))


def _compare_misfits(
    written: Placement, placement: Placement
) -> tuple[float, float] | None:
    """Misfit before and after, of positions or else of orientations; None if a
    correction does not convince."""
    before = written.misfit
    after = placement.misfit
    target = placement.observations.target
    extent = 0.0
    for number in np.unique(target):
        points = placement.predicted[target == number]
        distances = np.linalg.norm(points - points.mean(axis=0), axis=1)
        extent = max(extent, root_mean_square(distances))
    # If the robot hardly moves, any interpretation would fit that gathers the
    # measurements in one place.
    limit = np.minimum(
        before / FAR_BETTER, np.minimum(_IMPLAUSIBLE, [extent / FAR_BETTER, np.inf])
    )
    is_better = (before > _IMPLAUSIBLE) & (after < limit)
    is_no_worse = after <= np.maximum(_NO_WORSE * before, _IMPLAUSIBLE)
    for improved, unchanged in ((0, 1), (1, 0)):
        if is_better[improved] and is_no_worse[unchanged]:
            return float(before[improved]), float(after[improved])
    return None


def list_discrete_hypotheses(campaign: Campaign) -> list[Hypothesis]:
    """List all hypotheses without fitted values, the simplest first."""
    hypotheses = [*list_senses(campaign.robot.commands), *_list_lengths(campaign)]
    if campaign.measures_poses:
        return [
            *hypotheses,
            *_list_rotations(),
            _INVERTED,
            *_list_camera_axes(campaign),
            *_list_exchanged_axes(with_rotations=True),
        ]
    if campaign.frame != "tracker":
        return [*hypotheses, *_list_exchanged_axes(with_rotations=False)]
    # In a fitted frame, positions show no more than that they are mirrored.
    detail = (
        "the measurements are mirrored: two axes are exchanged, or one is turned round,"
        " or joints have the wrong sense"
    )
    mirrored = transform_columns(position=_multiply_by(np.diag([1.0, 1.0, -1.0])))
    return [*hypotheses, Hypothesis("swapped_axes", detail, mirrored)]


def list_fitted_hypotheses(campaign: Campaign) -> list[Hypothesis]:
    """List hypotheses on the placement of base and targets that the campaign states."""
    hypotheses = []
    targets = campaign.targets
    if campaign.frame == "base":
        read = partial(replace, frame="tracker")
        hypotheses.append(
            Hypothesis(
                "wrong_frame",
                "the base stands elsewhere",
                read,
                describe=_describe_base,
            )
        )
    unknown: dict[str, dict[str, Any]] = {}
    has_rotation = any(target.rotation is not None for target in targets)
    if campaign.measures_poses and has_rotation:
        unknown["targets have another orientation"] = {"rotation": None}
    if any(target.offset_m is not None for target in targets):
        unknown["targets sit elsewhere"] = {"offset_m": None, "rotation": None}
    for detail, fields in unknown.items():
        read = partial(_replace_target_fields, fields)
        hypotheses.append(
            Hypothesis("wrong_target", detail, read, describe=_describe_targets)
        )
    return hypotheses


def _invert_poses(campaign: Campaign) -> Campaign:
    """Read each measured pose as that of the session's frame in the target."""
    measurements = campaign.measurements
    if measurements.rotation_vector is None:
        return campaign
    inverse = Rotation.from_rotvec(measurements.rotation_vector).inv()
    inverted = replace(
        measurements,
        position=-inverse.apply(measurements.position),
        rotation_vector=inverse.as_rotvec(),
    )
    return replace(campaign, measurements=inverted)


_INVERTED = Hypothesis(
    "inverse_transform",
    "the poses fit inverted: the pose of the board in the camera stands where that of the"
    " camera in the board belongs, or the other way round",
    _invert_poses,
)


def _find_wrong_scale(campaign: Campaign) -> list[Fault]:
    """Find a board whose squares have another size than its program was set to.

    A camera or a board anywhere on the robot takes up most of such an error, so that
    less than an absurd distance may remain; no error of a robot looks like a factor.
    Units of lengths are left to the discrete hypotheses.
    """
    is_anywhere = campaign.frame == "tracker" and all(
        target.offset_m is None for target in campaign.targets
    )
    if not campaign.measures_poses or not is_anywhere:
        return []
    written = place_measurements(campaign).misfit
    if written[0] < _SCALED_M or written[1] > IMPLAUSIBLE_RAD:
        return []

    def compute_misfit(log_factor: float) -> float:
        misfit = place_measurements(_scale_positions(log_factor, campaign)).misfit
        # The misfit counts in the robot's metres, not in those of the camera.
        return float(misfit[0] / np.exp(log_factor))

    best = scipy.optimize.minimize_scalar(
        compute_misfit, bounds=_LOG_SCALES, method="bounded"
    )
    factor = float(np.exp(best.x))
    if abs(best.x) < _NEAR_SCALE or best.fun > written[0] / _SCALE_BETTER:
        return []
    size = "small" if factor > 1.0 else "large"
    detail = (
        f"the positions are all too {size}: measurements fit {factor:.4g} times the"
        f" written positions, as if the squares of a board were {factor:.4g} times as"
        " large as its program was set to"
    )
    evidence = float(written[0]), float(best.fun)
    parameters = (Value("factor of all positions", factor, "–"),)
    return [Fault("wrong_scale", (), detail, parameters, evidence)]


def _scale_positions(log_factor: float, campaign: Campaign) -> Campaign:
    factor = float(np.exp(log_factor))
    return transform_columns(position=partial(np.multiply, factor))(campaign)


def _describe_base(_: Placement, placement: Placement) -> str | None:
    """Sentence on a misplaced base, of several sessions the farthest."""
    distance = float(np.linalg.norm(placement.estimate.frame_position, axis=1).max())
    rotation = Rotation.from_matrix(placement.estimate.frame_rotation)
    angle = float(rotation.magnitude().max())
    if distance <= _NEAR_M and angle <= _NEAR_RAD:
        return None
    return (
        "measurements do not lie in the base frame: the robot would stand "
        f"{distance:.3g} m away, turned by {np.degrees(angle):.3g}°"
    )


def _describe_targets(written: Placement, placement: Placement) -> str | None:
    """Sentence on misplaced or rotated targets, with the remedy."""
    before = written.estimate
    after = placement.estimate
    targets = placement.model.targets
    angle = Rotation.from_matrix(
        before.target_rotation.transpose(0, 2, 1) @ after.target_rotation
    ).magnitude()
    distance = np.linalg.norm(after.target_offset - before.target_offset, axis=1)
    if distance.max() <= _NEAR_M and angle.max() <= IMPLAUSIBLE_RAD:
        return None
    wrong = {}
    if distance.max() > IMPLAUSIBLE_M:
        name = targets[int(np.argmax(distance))].name
        wrong["offset_m"] = f"{name} would sit {1e3 * distance.max():.3g} mm from there"
    if angle.max() > IMPLAUSIBLE_RAD:
        name = targets[int(np.argmax(angle))].name
        degrees = np.degrees(angle.max())
        wrong["rotation"] = f"{name} would be turned by {degrees:.3g}°"
    remedy = " and ".join(f"{key}: unknown" for key in wrong)
    return (
        f"targets do not sit where the campaign says: {' and '.join(wrong.values())};"
        f" if the mount differs from the stated one, write {remedy} in campaign.yaml to"
        " fit it, or its known values"
    )


def list_row_shifts(campaign: Campaign) -> list[Hypothesis]:
    """List hypotheses that the measured columns are shifted by one row.

    They need all measurements, because a subset has other neighbours.
    """
    measurements = campaign.measurements
    target = [measurements.session, measurements.target]
    groups = {
        "row": [measurements.session],
        "row of its target": target,
        "pose": [*target, measurements.load, measurements.repeat],
    }
    hypotheses = []
    for kind, keys in groups.items():
        group = group_equal_rows(np.column_stack(keys))[1]
        order = np.lexsort((measurements.row, group))
        is_same_group = group[order[1:]] == group[order[:-1]]
        # If each load has a number of its own, no row has a neighbour.
        if not is_same_group.any():
            continue
        previous = order[:-1][is_same_group]
        following = order[1:][is_same_group]
        for direction, source, rows in (
            ("down", previous, following),
            ("up", following, previous),
        ):
            detail = f"the measured columns fit one {kind} further {direction}"
            hypotheses.append(
                Hypothesis(
                    "shuffled_rows",
                    detail,
                    partial(_shift_measured, measurements, source, rows),
                )
            )
    return hypotheses


def list_exchanged_joints(joints: int) -> Iterator[Hypothesis]:
    """List pairs of joints whose columns are exchanged: another program counts or sorts
    the joints differently."""
    for first, second in combinations(range(joints), 2):
        order = np.arange(joints)
        order[[first, second]] = second, first
        detail = (
            f"the angles of joints {first + 1} and {second + 1} are exchanged:"
            " measurements fit with the columns the other way round"
        )
        read = partial(_multiply_angles, np.eye(joints)[order])
        yield Hypothesis("exchanged_joints", detail, read, (first + 1, second + 1))


def list_units_of_values() -> Iterator[Hypothesis]:
    """List units of lengths in which the column ``value`` may be written."""
    for unit, metres in _LENGTHS.items():
        detail = (
            f"the column value looks like {unit}: measurements fit {metres:g} times the"
            " written numbers"
        )
        read = transform_columns(position=partial(np.multiply, metres))
        yield Hypothesis("wrong_unit", detail, read)


def list_senses(joints: int) -> Iterator[Hypothesis]:
    """Joints that are counted in the other sense, then joints that are counted from their
    neighbours."""
    identity = np.eye(joints)
    for joint in range(joints):
        detail = (
            f"joint {joint + 1} has the wrong sense: "
            "measurements fit with its sign turned"
        )
        read = partial(_multiply_angles, np.diag(1.0 - 2.0 * identity[joint]))
        yield Hypothesis("wrong_sign", detail, read, (joint + 1,))
    signs = ((1.0, "added to"), (-1.0, "taken from"))
    for joint, (sign, verb) in product(range(joints - 1), signs):
        detail = (
            f"joint {joint + 2} is counted from joint {joint + 1}: measurements fit with"
            f" the angle of joint {joint + 1} {verb} it"
        )
        matrix = identity + sign * np.outer(identity[joint + 1], identity[joint])
        read = partial(_multiply_angles, matrix)
        yield Hypothesis("wrong_sign", detail, read, (joint + 1, joint + 2))


def _list_lengths(campaign: Campaign) -> Iterator[Hypothesis]:
    """Units of positions, then of the offsets of all targets, or of one of several."""
    for unit, metres in _LENGTHS.items():
        detail = (
            f"the positions look like {unit}: "
            f"measurements fit {metres:g} times the written positions"
        )
        read = transform_columns(position=partial(np.multiply, metres))
        yield Hypothesis("wrong_unit", detail, read)
    offset = [
        target.name
        for target in campaign.targets
        if target.offset_m is not None and any(target.offset_m)
    ]
    groups = [offset] if offset else []
    if len(offset) > 1:
        groups += [[name] for name in offset]
    for names, (unit, metres) in product(groups, _LENGTHS.items()):
        detail = (
            f"the target offset of {', '.join(names)} looks like {unit}: "
            f"measurements fit {metres:g} times what is written"
        )
        read = partial(_scale_offsets, names, metres)
        yield Hypothesis("wrong_unit", detail, read)


def _list_rotations() -> Iterator[Hypothesis]:
    detail = (
        "the rotation vectors fit inverted, as if they rotated base axes into those of"
        " the target"
    )
    read = transform_columns(rotation_vector=np.negative)
    yield Hypothesis("wrong_sign", detail, read)
    for letters, description in _EULER.items():
        detail = f"the columns of the rotation vector look like {description}, in rad"
        read = transform_columns(rotation_vector=partial(_from_angles, letters))
        yield Hypothesis("wrong_unit", detail, read)


def _list_camera_axes(campaign: Campaign) -> Iterator[Hypothesis]:
    """Positions of a board in other axes of the camera than its rotations.

    If both are in the same axes, the unknown mount of the camera takes up which. A
    camera beside the robot needs no hypothesis of its own, because its axes are those
    of the session.
    """
    if campaign.measuring.camera != ON_ROBOT:
        return
    detail = (
        "positions and rotations of the board have different axes: one of them is in the"
        " camera's optical frame (z forward, x right), the other in its link frame"
        " (x forward, z up)"
    )
    for axes in _CAMERA_AXES:
        yield Hypothesis("swapped_axes", detail, partial(_turn_in_camera, axes))


def _turn_in_camera(axes: np.ndarray, campaign: Campaign) -> Campaign:
    """Turn the positions of a board in the camera; the measurements are poses of the
    camera in the board."""
    measurements = campaign.measurements
    if measurements.rotation_vector is None:
        return campaign
    camera = Rotation.from_rotvec(measurements.rotation_vector)
    board_in_camera = camera.inv().apply(measurements.position)
    position = camera.apply(board_in_camera @ axes.T)
    return replace(campaign, measurements=replace(measurements, position=position))


def _list_exchanged_axes(*, with_rotations: bool) -> Iterator[Hypothesis]:
    """Exchanged or reversed axes, those with the fewest changes first; rotation vectors
    as written, or exchanged too."""
    matrices = [
        np.array(signs)[:, None] * np.eye(3)[list(order)]
        for order, signs in product(
            permutations(range(3)), product((1.0, -1.0), repeat=3)
        )
    ]
    matrices.sort(key=lambda matrix: np.abs(matrix - np.eye(3)).sum())
    for matrix in matrices[1:]:
        changes = _name_exchanged_axes(matrix)
        detail = f"the axes are exchanged: measurements fit with {changes}"
        exchange = _multiply_by(matrix)
        yield Hypothesis("swapped_axes", detail, transform_columns(position=exchange))
        if not with_rotations:
            continue
        handedness = np.linalg.det(matrix)
        for sign in sorted({1.0, handedness}):
            is_reversed = sign * handedness > 0 > handedness
            ending = ", turned round" if is_reversed else ""
            if any(np.array_equal(matrix, axes) for axes in _CAMERA_AXES):
                ending += (
                    ", as between a camera's optical frame (z forward, x right) and its"
                    " link frame (x forward, z up)"
                )
            yield Hypothesis(
                "swapped_axes",
                f"{detail}, and their rotation vectors likewise{ending}",
                transform_columns(
                    position=exchange, rotation_vector=_multiply_by(sign * matrix)
                ),
            )


def _name_exchanged_axes(matrix: np.ndarray) -> str:
    """Name the axes that a signed permutation changes, such as x = -y."""
    changes = []
    for axis, row in zip("xyz", matrix, strict=True):
        source = "xyz"[np.argmax(np.abs(row))]
        if row.min() < 0:
            source = f"-{source}"
        if source != axis:
            changes.append(f"{axis} = {source}")
    return ", ".join(changes)


def _from_angles(letters: str, angles: np.ndarray) -> np.ndarray:
    return Rotation.from_euler(letters, angles).as_rotvec()


def _multiply_by(matrix: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda vectors: vectors @ matrix.T


def transform_columns(
    **functions: Callable[[np.ndarray], np.ndarray],
) -> Callable[[Campaign], Campaign]:
    """Build the interpretation that applies functions to measured columns by their names,
    if the campaign has these columns."""

    def apply(campaign: Campaign) -> Campaign:
        changed = {}
        for name, function in functions.items():
            values = getattr(campaign.measurements, name)
            if values is not None:
                changed[name] = function(values)
        return replace(campaign, measurements=replace(campaign.measurements, **changed))

    return apply


def _shift_measured(
    measurements: Measurements,
    source: np.ndarray,
    rows: np.ndarray,
    campaign: Campaign,
) -> Campaign:
    """Replace the measured columns of rows by those of other rows."""
    measured = measurements.select(source)
    shifted = replace(
        measurements.select(rows),
        position=measured.position,
        rotation_vector=measured.rotation_vector,
    )
    return select_spread_poses(replace(campaign, measurements=shifted), _POSES)


def _multiply_angles(matrix: np.ndarray, campaign: Campaign) -> Campaign:
    """Multiply the joint angles of the file, which count from the controller's zeros."""
    robot = campaign.robot
    apply = transform_columns(
        joint_angles=lambda angles: robot.model_angles(
            robot.reported_angles(angles) @ matrix.T
        )
    )
    return apply(campaign)


def _replace_target_fields(fields: Mapping[str, Any], campaign: Campaign) -> Campaign:
    """Replace fields of the targets that were measured."""
    measured = set(campaign.measurements.target.tolist())
    targets = [
        replace(target, **fields) if number in measured else target
        for number, target in enumerate(campaign.targets)
    ]
    return replace(campaign, targets=tuple(targets))


def _scale_offsets(names: Sequence[str], factor: float, campaign: Campaign) -> Campaign:
    """Multiply the offsets of targets by a factor."""
    targets = []
    for target in campaign.targets:
        if target.name in names:
            offset_m = tuple(factor * value for value in target.offset_m or ())
            target = replace(target, offset_m=offset_m)
        targets.append(target)
    return replace(campaign, targets=tuple(targets))
