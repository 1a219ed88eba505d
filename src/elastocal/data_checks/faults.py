"""Find faults of the data before any physics: constant columns, other interpretations of
the file, wrong loads, implausible measurements.

In ambiguous cases no fault is reported: a false alarm stops a diagnosis that was right,
while a missed fault only leaves the data to later steps. Findings that do not stop a
diagnosis are warnings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import g, pound_force

from elastocal.campaigns.campaign import group_equal_rows
from elastocal.counting import format_digits
from elastocal.data_checks.contact_faults import find_contact_faults
from elastocal.data_checks.hypotheses import find_better_interpretation
from elastocal.data_checks.placement import (
    IMPLAUSIBLE_M,
    IMPLAUSIBLE_RAD,
    group_by_target,
    place_measurements,
    place_robustly,
    root_mean_square,
    select_spread_poses,
)
from elastocal.data_checks.protocol import Fault, Value
from elastocal.data_checks.swapped_places import find_swapped_places
from elastocal.fitting.least_squares import compute_negative_compliances
from elastocal.fitting.model import get_joint_compliances
from elastocal.fitting.observations import index_poses
from elastocal.mechanics.elastostatics import (
    build_regressor,
    compute_generalized_forces,
)
from elastocal.mechanics.kinematics import compute_jacobians, compute_position_jacobians

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.data_checks.placement import Placement
    from elastocal.fitting.least_squares import Fit

# Changes below these are below the last digit of sensors (0.1 µm) and controllers (about
# 1e-6 rad): the values are the same.
_SAME_M = 1e-6
_SAME_RAD = 1e-6
_MIN_POSES = 3
# Measurements this far from the nominal robot are implausible: five times more than
# geometric errors and deflections cause.
_MAX_DISTANCE_M = 5 * IMPLAUSIBLE_M
_MAX_ROTATION_RAD = 5 * IMPLAUSIBLE_RAD
# Largest ratio of an identified compliance and its reference. Compliances of a robot and
# published ones of its make differ by up to two or so; a factor of five is a unit, a sign
# or another effect that was taken for a joint's. The usual value for a robot's size is
# itself known to a factor of five.
_MAX_NOMINAL_RATIO = 5.0
_MAX_USUAL_RATIO = 25.0
# Standard errors by which a compliance is far off.
_NEGATIVE_STD_ERRORS = 2.0
_RIGID = (
    "the robot file states no joint compliances, so the joints are taken as rigid, and"
    " declared weights do not deflect them; measure under loads with compliance:"
    " identify, or state compliances"
)
# No robot follows its nominal kinematics this closely: a tenth of the errors of good
# robots. Rounding of angles to 0.001° causes less.
_MIN_ROBOT_ERROR_M = 3e-5
# Upper and lower bound on the poses that judge loads.
_MAX_LOADED_POSES = 150
_MIN_LOADED_POSES = 4
# Upper bound on the common ratio of a robot's compliances and those of its data sheet.
# No unit has a factor between a third and three.
_MAX_COMMON_RATIO = 1.7
# Share of the deflections that loads as written must leave unexplained, and share of that
# residual that corrected loads may leave.
_UNEXPLAINED_SHARE = 0.5
# Units whose residuals differ by less than this factor explain the deflections equally
# well; the compliances alone distinguish them.
_EQUIVALENT_RATIO = 1.1
# Loads of a pose do not differ if their squared deviations are below this share.
_MIN_DIFFERENCE_SHARE = 1e-6
# Newtons and newton metres for each unit in which loads may have been written, and a
# sentence about it.
LOAD_UNITS = (
    (1.0, 1.0, ""),
    (
        g,
        g,
        "the loads look like kilogram-force: measurements fit 9.81 times the written loads",
    ),
    (
        1 / g,
        1 / g,
        "measurements fit the written loads over 9.81, as if they had been converted twice",
    ),
    (
        1e3,
        1e3,
        "the loads look like kilonewtons: measurements fit 1000 times the written loads",
    ),
    (
        1e-3,
        1e-3,
        "the loads look like millinewtons: measurements fit a thousandth of the written loads",
    ),
    (
        pound_force,
        pound_force,
        "the loads look like pounds-force: measurements fit 4.45 times the written loads",
    ),
    (
        1 / pound_force,
        1 / pound_force,
        "measurements fit the written loads over 4.45, as if they had been converted twice",
    ),
    (
        1.0,
        1e-3,
        "the moments look like newton millimetres: measurements fit a thousandth of"
        " the written moments",
    ),
    (
        1e3,
        1.0,
        "the forces look like kilonewtons: measurements fit 1000 times the written forces",
    ),
    (
        g,
        1.0,
        "the forces look like kilogram-force: measurements fit 9.81 times the written forces",
    ),
)


def find_faults(campaign: Campaign) -> tuple[Fault, ...]:
    """Find the faults that the measurements of a campaign show.

    A check is skipped if a fault that was already found makes it meaningless. Campaigns
    with features have no positions that could be compared; they have checks of their
    own.
    """
    if campaign.measuring.channels:
        return tuple(find_swapped_places(campaign) or find_contact_faults(campaign))
    for find in (find_constant_columns, find_better_interpretation):
        faults = find(campaign)
        if faults:
            return tuple(faults)
    differences = compute_deflections(campaign)
    load_faults = find_wrong_loads(*differences) if differences else []
    return (*load_faults, *find_implausible_measurements(campaign))


def find_constant_columns(campaign: Campaign) -> list[Fault]:
    """Find positions that do not change while the robot moves, or joint angles that do
    not change while the measurements do.

    Returns one fault of each kind, of the first target that shows it.
    """
    subset = select_spread_poses(campaign)
    measurements = subset.measurements
    predicted = place_measurements(subset).predicted
    faults: dict[str, Fault] = {}
    for members in group_by_target(measurements):
        rows = measurements.select(members)
        poses = len(np.unique(rows.pose))
        if poses < _MIN_POSES:
            continue
        name = campaign.targets[rows.target[0]].name
        count = (Value("poses", float(poses), "–"),)
        extents = _principal_extents(predicted[members])
        for kind, detail, size_m in _describe_constant(rows, extents, name, poses):
            evidence = float(size_m), 0.0
            fault = Fault("constant_columns", (), detail, count, evidence)
            faults.setdefault(kind, fault)
    return list(faults.values())


def _describe_constant(
    rows: Measurements, expected_m: np.ndarray, name: str, poses: int
) -> Iterator[tuple[str, str, float]]:
    """Kind, sentence and expected size, m, of the columns of one target that are
    constant; `expected_m` (3,) are the extents that the joint angles imply."""
    # Extents ascend: a plane that is seen in its own axes has one constant column.
    constant = np.ptp(rows.position, axis=0) < _SAME_M
    if constant.any() and expected_m[constant.sum() - 1] > IMPLAUSIBLE_M:
        axes = ", ".join(np.array(list("xyz"))[constant])
        verb = "are" if constant.sum() > 1 else "is"
        value = "the same" if rows.position[:, constant].any() else "zero"
        detail = (
            f"{axes} of {name} {verb} {value} in all {poses} poses, "
            "though by its joint angles the robot moved"
        )
        yield axes, detail, expected_m[-1]
    measured_m = _principal_extents(rows.position)[-1]
    angle_range = np.ptp(rows.joint_angles, axis=0).max()
    if angle_range < _SAME_RAD and measured_m > IMPLAUSIBLE_M:
        detail = (
            f"the joint angles are the same in all {poses} poses, "
            f"though the measurements of {name} lie {measured_m:.2g} m apart"
        )
        yield "angles", detail, measured_m


def _principal_extents(points: np.ndarray) -> np.ndarray:
    """Ascending standard deviations of points along their principal axes, (3,), m."""
    deviations = points - points.mean(axis=0)
    variances = np.linalg.eigvalsh(deviations.T @ deviations / len(points))
    return np.sqrt(np.maximum(variances, 0.0))


def compute_deflections(campaign: Campaign) -> tuple[np.ndarray, np.ndarray] | None:
    """Compute differences of the deflections under the loads of each pose.

    Frames, targets and geometry cancel, because the mean of each target in each pose is
    subtracted (within transformation).

    Returns
    -------
    measured, expected : (R,) and (R, 2) arrays, m
        Rows are coordinates of measurements. Expected deflections are those by forces
        and by moments. None if loads do not differ within poses, if compliances are
        unknown, or with too few poses.
    """
    pose = index_poses(campaign.measurements)
    is_loaded = campaign.robot.compliance_known and campaign.measurements.wrench.any()
    if not is_loaded or pose.max() + 1 < _MIN_LOADED_POSES:
        return None
    chosen = np.linspace(0, pose.max(), _MAX_LOADED_POSES).round().astype(int)
    measurements = campaign.measurements.select(np.isin(pose, chosen))
    campaign = replace(campaign, measurements=measurements)
    # Frames and targets from the lowest loads, because loads in a wrong unit must not
    # enter them.
    robust = place_robustly(select_spread_poses(campaign)).estimate
    placement = place_measurements(campaign, robust)
    group = group_equal_rows(
        np.column_stack([index_poses(measurements), measurements.target])
    )[1]
    measured = placement.measured[0] - placement.predicted
    expected = _expect_deflections(campaign, placement)
    rows = np.stack([measured, *expected], axis=-1)
    totals = np.zeros((group.max() + 1, *rows.shape[1:]))
    np.add.at(totals, group, rows)
    differences = rows - (totals / np.bincount(group)[:, None, None])[group]
    square = (rows[..., 1:] ** 2).sum()
    if (differences[..., 1:] ** 2).sum() <= _MIN_DIFFERENCE_SHARE * square:
        return None
    return differences[..., 0].ravel(), differences[..., 1:].reshape(-1, 2)


def _expect_deflections(campaign: Campaign, placement: Placement) -> list[np.ndarray]:
    """Deflections of the targets by forces and by moments at nominal compliance, two
    (N, 3) arrays, m."""
    chain = campaign.robot.chain
    measurements = campaign.measurements
    offsets = placement.estimate.target_offset
    points = [
        replace(chain.point(target.point), offset_m=tuple(offset))
        for target, offset in zip(campaign.targets, offsets, strict=True)
    ]
    jacobian = compute_position_jacobians(
        chain, measurements.joint_angles, points, measurements.target
    )
    end_jacobian = compute_jacobians(
        chain,
        measurements.joint_angles,
        replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0)),
    )
    deflections = []
    for is_part in (np.arange(6) < 3, np.arange(6) >= 3):
        torques = compute_generalized_forces(
            end_jacobian, measurements.wrench * is_part
        )
        regressor = build_regressor(jacobian, torques)
        deflections.append(regressor @ campaign.robot.compliance)
    return deflections


def _list_load_units(
    measured: np.ndarray, expected: np.ndarray, largest_share: float
) -> list[_LoadUnit]:
    """List the units of loads that leave at most a share of the deflections unexplained."""
    units = []
    for force, moment, detail in LOAD_UNITS:
        corrected = expected @ (force, moment)
        sign = float(np.sign(corrected @ measured))
        residual, share, ratio = _compare_deflections(measured, sign * corrected)
        if share <= largest_share:
            units.append(_LoadUnit(ratio, residual, sign, force, moment, detail))
    return units


def find_wrong_loads(measured: np.ndarray, expected: np.ndarray) -> list[Fault]:
    """Find the sign and the unit that explain deflections far better than the loads as
    written.

    Of units that explain them equally well, the unit whose compliances are closest to
    the nominal ones is reported; the next one is its alternative. Arguments are those of
    `compute_deflections`.
    """
    as_written = expected.sum(axis=1)
    before, share_before, _ = _compare_deflections(measured, as_written)
    if share_before < _UNEXPLAINED_SHARE:
        return []
    candidates = _list_load_units(measured, expected, _UNEXPLAINED_SHARE * share_before)
    if not candidates:
        return []
    limit = _EQUIVALENT_RATIO * min(unit.residual_m for unit in candidates)
    equivalent = sorted(unit for unit in candidates if unit.residual_m <= limit)
    slope = float(as_written @ measured / (as_written @ as_written))
    return _report_wrong_loads(equivalent, before, slope)


@dataclass(frozen=True, order=True)
class _LoadUnit:
    """A unit and sign of loads that explain deflections; the first has the compliances
    that are closest to the nominal ones."""

    log_ratio: float
    residual_m: float
    sign: float
    force: float
    moment: float
    detail: str


def _report_wrong_loads(
    units: list[_LoadUnit], before_m: float, slope: float
) -> list[Fault]:
    """Faults of the first unit, with the next one as an alternative."""
    best = units[0]
    evidence = before_m, best.residual_m
    ratio = Value("deflection over the one expected", slope, "–")
    faults = []
    if best.sign < 0:
        detail = (
            "the loads fit with the opposite sign, as if they were the forces of the robot"
            " on its surroundings"
        )
        faults.append(Fault("wrong_sign", (), detail, (ratio,), evidence))
    if best.detail:
        parameters = (
            Value("newtons for each unit of force written", best.force, "N"),
            Value("newton metres for each unit of moment written", best.moment, "N m"),
            ratio,
        )
        alternatives = tuple(unit.detail for unit in units[1:2])
        faults.append(
            Fault("wrong_unit", (), best.detail, parameters, evidence, alternatives)
        )
    return faults


def _compare_deflections(
    measured: np.ndarray, expected: np.ndarray
) -> tuple[float, float, float]:
    """Compare measured deflections (R,) with expected ones times the best plausible ratio
    of compliances.

    Returns the RMS residual, m; its share of the larger of both deflections, at most 1,
    so that loads in too small and too large units are treated alike; and the magnitude
    of the logarithm of the ratio.
    """
    ratio = np.clip(
        expected @ measured / (expected @ expected),
        1 / _MAX_COMMON_RATIO,
        _MAX_COMMON_RATIO,
    )
    residual = root_mean_square(measured - ratio * expected)
    size = max(root_mean_square(measured), ratio * root_mean_square(expected))
    return residual, min(residual / size, 1.0), float(abs(np.log(ratio)))


def find_implausible_measurements(campaign: Campaign) -> list[Fault]:
    """Find measurements that are absurdly far from the nominal robot for a reason that no
    other fault names; at most one fault."""
    subset = select_spread_poses(campaign)
    # The first placement suffices for nearly all campaigns and takes a sixth of the time.
    for place in (place_measurements, place_robustly):
        placement = place(subset)
        distance, angle = map(float, placement.misfit)
        if distance < _MAX_DISTANCE_M and angle < _MAX_ROTATION_RAD:
            return []
    misfit = f"orientations lie {angle:.2g} rad"
    if distance >= _MAX_DISTANCE_M:
        misfit = f"positions lie {distance:.2g} m"
    detail = (
        f"{misfit} (RMS) from where the robot file puts them, and no other sense, unit,"
        " axis, frame or order of rows explains it: check the chain, the zeros of the"
        " joints, the measuring points and the columns"
    )
    parameters = (
        Value("RMS distance of positions", distance, "m"),
        Value("RMS turn of orientations", angle, "rad"),
    )
    rms = root_mean_square(placement.distance)
    return [Fault("implausible_measurements", (), detail, parameters, (rms, rms))]


def warn_of_compliances(fitted: Fit) -> list[str]:
    """Warn of identified joint compliances that are negative or far from their reference.

    There is no warning if measurements are wrong by centimetres, because compliances
    mean nothing then. If compliances are neither identified nor known, and weights are
    declared, the warning says that the joints are taken as rigid.
    """
    model = fitted.model
    if not model.identifies_compliance:
        # Loads would need compliances, so declared weights are the only load here.
        is_rigid = not model.compliance_known and model.sites.masses
        return [_RIGID] if is_rigid else []
    distances = np.linalg.norm(fitted.residual[:, :3], axis=1)
    if root_mean_square(distances) > IMPLAUSIBLE_M:
        return []
    indices = fitted.parameter_indices("joint_compliance")
    std_error = np.sqrt(np.diag(fitted.covariance))[indices]
    compliance = get_joint_compliances(model, fitted.estimate)
    nominal = model.nominal_compliance
    is_identified = fitted.identified[indices]
    is_negative = compute_negative_compliances(fitted) > _NEGATIVE_STD_ERRORS
    ratio = _MAX_USUAL_RATIO
    reference = "usual for such a robot"
    if model.compliance_known:
        ratio = _MAX_NOMINAL_RATIO
        reference = "nominal"
    is_far = (compliance < nominal / ratio) | (compliance > ratio * nominal)
    is_far &= np.abs(compliance - nominal) > _NEGATIVE_STD_ERRORS * std_error
    joints = [
        f"joint {joint + 1} {'below ' if is_negative[joint] else ''}"
        f"{format_digits(1e6 * compliance[joint], 3)}"
        f" ± {format_digits(1e6 * std_error[joint], 2)}"
        f" ({reference} {format_digits(1e6 * nominal[joint], 3)})"
        for joint in np.flatnonzero(is_identified & (is_far | is_negative))
    ]
    if not joints:
        return []
    return [
        f"implausible joint compliances, in µrad/(N·m): {', '.join(joints)}; check the "
        "sign and the unit of the loads, and whether another part is elastic too"
    ]


def warn_of_computed_positions(campaign: Campaign) -> list[str]:
    """Warn of positions that a controller computed by the kinematics of the robot file."""
    if campaign.measuring.channels:
        return []
    rms_m = root_mean_square(place_measurements(campaign).distance)
    if rms_m > _MIN_ROBOT_ERROR_M:
        return []
    return [
        "positions agree with the kinematics of the robot file to"
        f" {1e6 * rms_m:.2g} µm, better than any robot does: a controller computed them from"
        " the joint angles; they are not measurements, and show nothing of the robot"
    ]
