"""Every fault of the data, sought before any physics: constant columns, other
interpretations, loads, nonsense.

Where it is ambiguous none is found: a false alarm stops a trace that was right, a miss
only leaves it to what comes after. What stops nothing is a warning.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import g, pound_force

from elastocal.campaigns.campaign import group_equal_rows
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
from elastocal.fitting.model import get_joint_compliances
from elastocal.fitting.observations import index_poses
from elastocal.mechanics.elastostatics import (
    build_regressor,
    compute_generalized_forces,
)
from elastocal.mechanics.kinematics import compute_jacobians, compute_position_jacobians

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign
    from elastocal.fitting.least_squares import Fit

# Below the last digit that any sensor writes (0.1 µm) and any controller reports (1e-6
# rad or so).
_SAME_M = 1e-6
_SAME_RAD = 1e-6
_FEWEST_POSES = 3
# Five times what no geometric error and no deflection makes.
_FARTHEST_M = 5 * IMPLAUSIBLE_M
_FARTHEST_RAD = 5 * IMPLAUSIBLE_RAD
# Compliances of a robot and those published for its make differ by up to two or so;
# five is a unit, a sign or another effect that was taken for a joint's. What is usual
# for a robot's size is itself known to a factor of five.
_MOST_OFF_NOMINAL = 5.0
_MOST_OFF_USUAL = 25.0
_RIGID = (
    "the robot file states no joint compliances: the joints are taken as rigid, and do not yield to the weights that it may"
    " state; load the robot and set compliance to identify, or state them"
)
# No robot goes where its nominal kinematics are to less: a tenth of what good robots
# are off. Rounding to 0.001° is less.
_NO_ROBOT_M = 3e-5

# Poses that loads are judged by.
_MOST_LOADED = 150
_FEWEST_LOADED = 4
# Compliances of a robot and those of its data sheet differ by no more, all together;
# one between a third and three times is nobody's unit.
_RATIO = 1.7
# Share of the deflections that loads as written must leave, and share of that which
# corrected loads may leave.
_UNEXPLAINED = 0.5
# Units that explain the deflections as well as each other, but for so much, are
# distinguished by the compliances alone.
_AS_WELL = 1.1
# Below this share of their square, loads of one pose do not differ.
_DIFFERING = 1e-6
# Newtons and newton metres for each unit in which loads may have been written, and the
# words for it.
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
        "the moments look like newton millimetres: measurements fit a thousandth of the written moments",
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
    """Every fault that the measurements of a campaign show; none is looked for where
    another one makes that meaningless."""
    for find in (find_constant_columns, find_better_interpretation):
        if found := find(campaign):
            return tuple(found)
    differences = compute_deflections(campaign)
    return (
        *(find_wrong_loads(*differences) if differences else ()),
        *find_implausible_measurements(campaign),
    )


def find_constant_columns(campaign: Campaign) -> list[Fault]:
    """Positions that stay where they are while the robot moves, or joint angles that do
    not while the measurements do.

    Returns one for each kind, of the first target that shows it.
    """
    some = select_spread_poses(campaign).measurements
    predicted = place_measurements(select_spread_poses(campaign)).predicted
    found: dict[str, Fault] = {}
    for members in group_by_target(some):
        if (poses := len(np.unique(some.pose[members]))) < _FEWEST_POSES:
            continue
        measured = some.position[members]
        who = campaign.targets[some.target[members[0]]].name
        kinds = {}
        # Standard deviations along the main axes, the smallest first: a plane seen in
        # its own axes has one constant column.
        needed = _extents(predicted[members])
        moved = _extents(measured)[-1]
        still = np.ptp(measured, axis=0) < _SAME_M
        if still.any() and needed[still.sum() - 1] > IMPLAUSIBLE_M:
            axes = ", ".join(np.array(list("xyz"))[still])
            verb = "are" if still.sum() > 1 else "is"
            where = "zero" if not measured[:, still].any() else "the same"
            detail = f"{axes} of {who} {verb} {where} in all {poses} poses, though by its joint angles the robot moved"
            kinds[axes] = detail, needed[-1]
        if (
            np.ptp(some.joint_angles[members], axis=0).max() < _SAME_RAD
            and moved > IMPLAUSIBLE_M
        ):
            same = f"the joint angles are the same in all {poses} poses"
            kinds["angles"] = (
                f"{same}, though the measurements of {who} lie {moved:.2g} m apart",
                moved,
            )
        count = (Value("poses", float(poses), "–"),)
        for kind, (detail, size) in kinds.items():
            found.setdefault(
                kind, Fault("constant_columns", (), detail, count, (float(size), 0.0))
            )
    return list(found.values())


def _extents(points: np.ndarray) -> np.ndarray:
    """Standard deviations of points along their principal axes, rising, ndarray (3,),
    m."""
    off = points - points.mean(axis=0)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(off.T @ off / len(points)), 0.0))


def compute_deflections(campaign: Campaign) -> tuple[np.ndarray, np.ndarray] | None:
    """Differences between the loads of each pose: those seen (R,), and those expected
    of forces and of moments (R, 2), m.

    Rows are coordinates of measurements. Frames, targets and geometry are taken off as
    means of each target in each pose (within transformation). None where loads do not
    differ within poses, compliances are not known or poses are too few.
    """
    pose = index_poses(campaign.measurements)
    loaded = campaign.robot.compliance_known and campaign.measurements.wrench.any()
    if not loaded or pose.max() + 1 < _FEWEST_LOADED:
        return None
    measurements = campaign.measurements.select(
        np.isin(pose, np.linspace(0, pose.max(), _MOST_LOADED).round().astype(int))
    )
    campaign, chain = replace(campaign, measurements=measurements), campaign.robot.chain
    # Frames and targets from the lowest loads: those of a wrong unit must not enter.
    whole = place_measurements(
        campaign, place_robustly(select_spread_poses(campaign)).estimate
    )
    targets = zip(campaign.targets, whole.estimate.target_offset, strict=True)
    points = [
        replace(chain.point(target.point), offset_m=tuple(at)) for target, at in targets
    ]
    jacobian = compute_position_jacobians(
        chain, measurements.joint_angles, points, measurements.target
    )
    end = compute_jacobians(
        chain,
        measurements.joint_angles,
        replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0)),
    )
    torques = [
        compute_generalized_forces(
            end, measurements.wrench * (np.arange(6) // 3 == part)
        )
        for part in (0, 1)
    ]
    expected = [
        build_regressor(jacobian, each) @ campaign.robot.compliance for each in torques
    ]
    group = group_equal_rows(
        np.column_stack([index_poses(measurements), measurements.target])
    )[1]
    rows = np.stack([whole.measured[0] - whole.predicted, *expected], axis=-1)
    mean = np.zeros((group.max() + 1, *rows.shape[1:]))
    np.add.at(mean, group, rows)
    off = rows - (mean / np.bincount(group)[:, None, None])[group]
    if (off[..., 1:] ** 2).sum() <= _DIFFERING * (rows[..., 1:] ** 2).sum():
        return None
    return off[..., 0].ravel(), off[..., 1:].reshape(-1, 2)


def find_wrong_loads(seen: np.ndarray, expected: np.ndarray) -> list[Fault]:
    """The sign and the unit that explain deflections, see `deflections`, far better
    than the loads as written, if any do.

    Of units that explain them as well, the one that brings the compliances nearest to
    the nominal ones, beside the next one.
    """
    as_written = expected.sum(axis=1)
    before, share, _ = _left(seen, as_written)
    found = []
    for force, moment, detail in LOAD_UNITS:
        corrected = expected @ (force, moment)
        sign = float(np.sign(corrected @ seen))
        after, share_after, off = _left(seen, sign * corrected)
        if share >= _UNEXPLAINED and share_after <= _UNEXPLAINED * share:
            found.append((off, after, sign, force, moment, detail))
    as_well = sorted(
        each for each in found if each[1] <= _AS_WELL * min(other[1] for other in found)
    )
    if not as_well:
        return []
    (_, after, sign, force, moment, detail), *others = as_well
    slope = Value(
        "deflection over the one expected",
        float(as_written @ seen / (as_written @ as_written)),
        "–",
    )
    faults = []
    if sign < 0:
        turned = "the loads fit turned round, as if they were written as what the robot does to its surroundings"
        faults.append(Fault("wrong_sign", (), turned, (slope,), (before, after)))
    if detail:
        units = (
            Value("newtons for each unit of force written", force, "N"),
            Value("newton metres for each unit of moment written", moment, "N m"),
        )
        less_likely = tuple(other[-1] for other in others[:1])
        faults.append(
            Fault(
                "wrong_unit",
                (),
                detail,
                (*units, slope),
                (before, after),
                alternatives=less_likely,
            )
        )
    return faults


def _left(seen: np.ndarray, expected: np.ndarray) -> tuple[float, float, float]:
    """What expected deflections (R,), times the best factor that robots have, leave of
    those seen: RMS in m, and share up to 1.

    The share is of those expected where they are the larger: the same for loads written
    too small and too large. The last is how far that factor is from 1, of its
    logarithm.
    """
    factor = np.clip(expected @ seen / (expected @ expected), 1 / _RATIO, _RATIO)
    left = root_mean_square(seen - factor * expected)
    return (
        left,
        min(
            left / max(root_mean_square(seen), factor * root_mean_square(expected)), 1.0
        ),
        float(abs(np.log(factor))),
    )


def find_implausible_measurements(campaign: Campaign) -> list[Fault]:
    """Measurements absurdly far from the nominal robot, for a reason that no other
    fault names; one fault, or none."""
    # Nearly all campaigns are done with the first, which takes a sixth of the time.
    for place in (place_measurements, place_robustly):
        placement = place(select_spread_poses(campaign))
        away, turned = map(float, placement.misfit)
        if away < _FARTHEST_M and turned < _FARTHEST_RAD:
            return []
    what = (
        f"positions lie {away:.2g} m"
        if away >= _FARTHEST_M
        else f"orientations lie {turned:.2g} rad"
    )
    detail = (
        f"{what} (RMS) from where the robot file puts them, and no other sense, unit, axis, frame or order of rows that was"
        " tried mends it: chain, zeros of the joints, measuring points and columns need a look"
    )
    parameters = (
        Value("RMS distance of positions", away, "m"),
        Value("RMS turn of orientations", turned, "rad"),
    )
    return [
        Fault(
            "implausible_measurements",
            (),
            detail,
            parameters,
            (root_mean_square(placement.distance),) * 2,
        )
    ]


def warn_of_compliances(fitted: Fit) -> list[str]:
    """Name the identified joint compliances of a fit that are negative, or far off
    nominal either way, in one sentence.

    None where measurements are wrong by centimetres: compliances mean nothing there.
    Where they are neither identified nor known, that the joints are taken as rigid.
    """
    model = fitted.model
    if not model.identifies_compliance:
        return [] if model.compliance_known else [_RIGID]
    if root_mean_square(np.linalg.norm(fitted.residual[:, :3], axis=1)) > IMPLAUSIBLE_M:
        return []
    std_error = np.sqrt(np.diag(fitted.covariance))[
        fitted.parameter_indices("joint_compliance")
    ]
    found = get_joint_compliances(model, fitted.estimate)
    nominal = model.nominal_compliance
    most, word = (
        (_MOST_OFF_NOMINAL, "nominal")
        if model.compliance_known
        else (_MOST_OFF_USUAL, "usual for such a robot")
    )
    # What has no standard error was not identified.
    off = (std_error > 0) & ((found < nominal / most) | (found > most * nominal))
    named = [
        f"joint {j + 1} {1e6 * found[j]:.3g} ± {1e6 * std_error[j]:.2g} ({word} {1e6 * nominal[j]:.3g})"
        for j in np.flatnonzero(off)
    ]
    remedy = "check the sign and the unit of the loads, and whether something else yields too"
    return (
        [
            f"joint compliances beyond what robots have, in µrad/(N·m): {', '.join(named)}; {remedy}"
        ]
        if named
        else []
    )


def warn_of_computed_positions(campaign: Campaign) -> list[str]:
    """Say where positions are those of the robot file's own kinematics, as a controller
    works them out."""
    off = root_mean_square(place_measurements(campaign).distance)
    if off > _NO_ROBOT_M:
        return []
    return [
        f"positions are those of the robot file's own kinematics to {1e6 * off:.2g} µm, nearer than any robot goes: a"
        " controller worked them out of the joint angles; they are no measurements, and show nothing of the robot"
    ]
