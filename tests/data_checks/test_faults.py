"""Faults are named where they are, and none where the model is right or only lacks
something."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import (
    POINTS,
    Plan,
    add_geometric_errors,
    change_compliances,
    make_campaign,
    replace_measured_columns,
)
from support import PinocchioPoint
from synthetic import NOISE

from elastocal.data_checks.faults import (
    LOAD_UNITS,
    compute_deflections,
    find_constant_columns,
    find_faults,
    find_implausible_measurements,
    find_wrong_loads,
    warn_of_compliances,
    warn_of_computed_positions,
)
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import build_declared_model
from elastocal.fitting.observations import average_repeats
from elastocal.mechanics.robot import Mass

PLANS = {
    "base": Plan(poses=10, loads=2),
    "tracker": Plan(poses=15, tracker=True),
    "positions": Plan(poses=20, tracker=True, oriented=False, loads=1, repeats=2),
    "few poses": Plan(poses=8, loads=2),
    "small loads": Plan(poses=10, loads=2, force=20.0),
    "no noise": Plan(poses=10, loads=2, noise=0.0),
}


# Each plan with a seed of its own.
@pytest.mark.parametrize(("seed", "plan"), list(enumerate(PLANS)))
def test_no_fault_is_found_where_the_model_is_right(fanuc, plan, seed):
    assert find_faults(make_campaign(fanuc, seed, PLANS[plan])) == ()


@pytest.mark.parametrize(("seed", "plan"), list(enumerate(PLANS)))
def test_no_fault_is_found_where_the_model_lacks_something(kuka, plan, seed):
    """Springs, zeros, a sag and lengths off, which is most at once."""
    offsets = np.random.default_rng(seed).normal(0.0, 3e-3, kuka.joints)
    true_robot = add_geometric_errors(change_compliances(kuka, seed, 0.5), seed, 0.01)
    assert (
        find_faults(
            make_campaign(kuka, seed, PLANS[plan], true_robot, offsets, sag=3e-3)
        )
        == ()
    )


def test_a_wrong_sign_is_found_alone(fanuc):
    campaign = make_campaign(fanuc, 1, Plan(poses=20))
    turned = replace_measured_columns(
        campaign, joint_angles=campaign.measurements.joint_angles * [1, 1, -1, 1, 1, 1]
    )
    assert [fault.name for fault in find_faults(turned)] == ["wrong_sign"]


@pytest.fixture(scope="module", params=["base", "tracker"])
def twelve_poses(request, fanuc):
    return make_campaign(fanuc, 1, Plan(poses=12, tracker=request.param == "tracker"))


@pytest.mark.parametrize(
    ("kept", "phrase"),
    [((0, 0, 0), "x, y, z of"), ((1, 1, 0), "z of"), ((0, 1, 0), "x, z of")],
)
@pytest.mark.parametrize(("value", "same"), [(0.0, "zero"), (1.5, "the same")])
def test_positions_that_stand_still_are_named(twelve_poses, kept, phrase, value, same):
    still = np.where(kept, twelve_poses.measurements.position, value)
    (fault,) = find_constant_columns(
        replace_measured_columns(twelve_poses, position=still)
    )
    assert fault.name == "constant_columns"
    assert (
        fault.detail.startswith(phrase) and f" {same} in all 12 poses" in fault.detail
    )


def test_constant_angles_are_a_fault_unless_one_pose_was_measured_repeatedly(
    twelve_poses,
):
    measured_rows = twelve_poses.measurements
    still = replace_measured_columns(
        twelve_poses, joint_angles=np.full_like(measured_rows.joint_angles, 0.4)
    )
    (fault,) = find_constant_columns(still)
    assert fault.detail.startswith("the joint angles are the same in all 12 poses")
    again = (
        measured_rows.position[: len(POINTS)][measured_rows.target]
        + 1e-5 * measured_rows.pose[:, None]
    )
    assert find_constant_columns(replace_measured_columns(still, position=again)) == []


def test_a_robot_that_moves_in_a_plane_may_have_a_constant_coordinate(fanuc):
    campaign = make_campaign(
        fanuc,
        1,
        Plan(poses=12, noise=0.0, loads=0),
        moving={1: 0, 2: 0, 3: 0, 4: 0, 5: 0},
    )
    assert (
        np.ptp(campaign.measurements.position[campaign.measurements.target == 3, 2])
        < 1e-9
    )
    assert find_constant_columns(campaign) == []


@pytest.fixture(scope="module", params=["base", "tracker"])
def campaign(request, fanuc):
    return make_campaign(
        fanuc,
        1,
        Plan(tracker=request.param == "tracker"),
        change_compliances(fanuc, 1, 0.3),
    )


def with_rows(campaign, source):
    measured_rows = campaign.measurements
    return replace_measured_columns(
        campaign,
        position=measured_rows.position[source],
        rotation_vector=measured_rows.rotation_vector[source],
    )


@pytest.mark.parametrize(
    ("steps", "phrase"), [(1, "row further up"), (-1, "row further down")]
)
def test_measured_columns_moved_by_one_row_are_named(campaign, steps, phrase):
    (fault,) = find_faults(
        with_rows(campaign, np.roll(np.arange(len(campaign.measurements)), steps))
    )
    assert fault.name == "shuffled_rows" and phrase in fault.detail


@pytest.mark.parametrize("tracker", [True, False])
def test_measurements_of_another_robot_are_named_and_those_of_one_off_by_centimetres_are_not(
    fanuc, kuka, tracker
):
    campaign = make_campaign(fanuc, 1, Plan(poses=20, tracker=tracker))
    (fault,) = find_implausible_measurements(replace(campaign, robot=kuka))
    assert fault.name == "implausible_measurements"
    assert fault.parameters[0].value > 0.1 and "\n" not in fault.detail
    deviating = make_campaign(
        fanuc,
        1,
        Plan(poses=20, tracker=tracker),
        add_geometric_errors(fanuc, 1, 0.01),
        5e-3,
        sag=5e-3,
    )
    assert find_implausible_measurements(deviating) == []


def warned(robot, factors=1.0, turned=1.0, *, is_known=True):
    """Warnings of a fit of the compliances of a robot that are so many times those that
    its file states, or are usual."""
    file = replace(robot, compliance_known=is_known)
    campaign = make_campaign(
        file, 1, Plan(poses=12), replace(robot, compliance=robot.compliance * factors)
    )
    campaign = replace_measured_columns(
        campaign, wrench=turned * campaign.measurements.wrench
    )
    return warn_of_compliances(
        fit_model(
            build_declared_model(campaign),
            average_repeats(campaign.measurements),
            NOISE,
        )
    )


@pytest.mark.parametrize(
    ("factor", "is_known", "phrase"),
    [
        (0.3, True, ""),
        (3.0, True, ""),
        (9.8, True, "nominal"),
        (0.1, True, "nominal"),
        (9.8, False, ""),
    ],
)
def test_a_compliance_that_no_robot_has_is_named_with_its_standard_error(
    fanuc, factor, is_known, phrase
):
    reported = warned(fanuc, [1, factor, 1, 1, 1, 1], is_known=is_known)
    assert len(reported) == bool(phrase)
    for warning in reported:
        assert (
            "joint 2 " in warning
            and "joint 3" not in warning
            and "±" in warning
            and phrase in warning
        )


def test_loads_turned_round_are_seen_by_compliances_below_zero_and_joints_without_any_are_rigid(
    fanuc,
):
    (warning,) = warned(fanuc, turned=-1.0, is_known=False)
    assert (
        all(f"joint {joint} below 0 " in warning for joint in range(1, 7))
        and "usual for such a robot" in warning
    )
    heavy = Mass(3, 40.0, (0.1, 0.0, 0.0), 0.1)
    for masses, count in (((heavy,), 1), ((), 0)):
        robot = replace(fanuc, compliance_known=False, masses=masses)
        rigid = replace(make_campaign(robot, 1), compliance="nominal")
        warnings = warn_of_compliances(
            fit_model(
                build_declared_model(rigid), average_repeats(rigid.measurements), NOISE
            )
        )
        assert len(warnings) == count
        assert all("taken as rigid" in warning for warning in warnings)


@pytest.mark.parametrize("tracker", [True, False])
@pytest.mark.parametrize(("decimals_deg", "decimals_mm"), [(12, 12), (4, 3), (3, 2)])
def test_positions_of_the_files_own_kinematics_are_said_to_be_no_measurements(
    fanuc, tracker, decimals_deg, decimals_mm
):
    """Angles and positions rounded as a controller shows them."""
    campaign = make_campaign(
        fanuc, 1, Plan(poses=14, loads=0, tracker=tracker, oriented=False, noise=0.0)
    )
    angles = np.radians(
        np.degrees(campaign.measurements.joint_angles).round(decimals_deg)
    )
    position = (1e3 * campaign.measurements.position).round(decimals_mm) / 1e3
    (sentence,) = warn_of_computed_positions(
        replace_measured_columns(campaign, joint_angles=angles, position=position)
    )
    assert "not measurements" in sentence and "the kinematics" in sentence
    measured = position + 6e-5 * np.random.default_rng(1).standard_normal(
        position.shape
    )
    assert (
        warn_of_computed_positions(
            replace_measured_columns(campaign, joint_angles=angles, position=measured)
        )
        == []
    )


EXACT = Plan(poses=6, loads=2, noise=0.0)
JOINTS = 6


@pytest.fixture(scope="module")
def exact(fanuc):
    return make_campaign(fanuc, 1, EXACT)


def expected_parts(robot, measured_rows, components):
    """Deflection of each target by each joint at nominal compliance from forces or
    moments alone, ndarray (N, 3, n)."""
    end = PinocchioPoint(robot.chain, robot.chain.end_effector)
    points = [PinocchioPoint(robot.chain, robot.chain.point(name)) for name in POINTS]
    parts = []
    for q, wrench, target in zip(
        measured_rows.joint_angles,
        measured_rows.wrench,
        measured_rows.target,
        strict=True,
    ):
        torques = end.pose_and_jacobian(q)[2][components].T @ wrench[components]
        parts.append(
            points[target].pose_and_jacobian(q)[2][:3] * torques * robot.compliance
        )
    return np.array(parts)


def less_group_means(values, *keys):
    group = np.unique(np.column_stack(keys), axis=0, return_inverse=True)[1].ravel()
    return np.array(
        [
            value - values[group == number].mean(axis=0)
            for value, number in zip(values, group, strict=True)
        ]
    )


def test_deflections_are_those_of_each_joint_by_pinocchio_less_the_mean_of_target_and_pose(
    fanuc, exact
):
    measured_rows = exact.measurements
    measured, expected = compute_deflections(exact)
    for by, components in ((0, slice(0, 3)), (1, slice(3, 6))):
        whole = expected_parts(fanuc, measured_rows, components).sum(axis=2)
        reference = less_group_means(whole, measured_rows.pose, measured_rows.target)
        np.testing.assert_allclose(
            expected[:, by].reshape(-1, 3), reference, rtol=0, atol=1e-12
        )
    # Second order in turns of some milliradians over metres.
    np.testing.assert_allclose(measured, expected.sum(axis=1), rtol=0, atol=2e-4)
    assert np.abs(measured).max() > 1e-3


def selected(campaign, kept):
    return replace(campaign, measurements=campaign.measurements.select(kept))


def test_joints_off_their_zeros_leave_no_trace_in_the_deflections(fanuc):
    plan = Plan(poses=40, loads=1, noise=0.0)
    straight, deviating = (
        make_campaign(fanuc, 1, plan, true_offset=offset)
        for offset in (0.0, 2e-3 * np.array([1, -1, 1, -1, 1, -1]))
    )
    assert (
        np.linalg.norm(
            deviating.measurements.position - straight.measurements.position, axis=1
        ).max()
        > 3e-3
    )
    (one, _), (second, _) = map(compute_deflections, (straight, deviating))
    # What is left is of second order: two milliradians of every deflection.
    assert np.abs(second - one).max() < 0.02 * np.abs(one).max()


def test_without_differing_loads_known_compliances_or_enough_poses_there_is_no_result(
    exact,
):
    measured_rows = exact.measurements
    assert compute_deflections(selected(exact, measured_rows.load == 1)) is None
    assert (
        compute_deflections(
            replace_measured_columns(exact, wrench=0.0 * measured_rows.wrench)
        )
        is None
    )
    assert (
        compute_deflections(
            replace(exact, robot=replace(exact.robot, compliance_known=False))
        )
        is None
    )
    assert compute_deflections(selected(exact, measured_rows.pose < 3)) is None
    assert compute_deflections(selected(exact, measured_rows.pose < 4)) is not None


def made_deflections(sign=1.0, force=1.0, moment=1.0, ratios=1.0, noise=1e-2):
    """Simulate the deflections of joints whose compliances are multiples (`ratios`) of
    those in the robot file, as they appear when the loads are in another unit."""
    rng = np.random.default_rng(1)
    by_force, by_moment = 1e-3 * rng.standard_normal((2, 450, JOINTS))
    measured = (
        sign * (force * by_force + moment * by_moment) @ (ratios * np.ones(JOINTS))
    )
    measured = measured + noise * np.abs(measured).max() * rng.standard_normal(450)
    return measured, np.stack([by_force.sum(axis=1), by_moment.sum(axis=1)], axis=1)


KILOGRAM = 9.80665
POUND = 4.4482216152605


def decode_load_faults(faults):
    """Sign, newtons and newton metres for each unit, and the words of each fault, of
    what is found."""
    unit = [
        value.value
        for fault in faults
        if fault.name == "wrong_unit"
        for value in fault.parameters[:2]
    ]
    return (-1.0 if "wrong_sign" in [fault.name for fault in faults] else 1.0), *(
        unit or [1.0, 1.0]
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("force", "moment", "phrase"), LOAD_UNITS)
def test_every_unit_and_sign_is_found_from_the_deflections(sign, force, moment, phrase):
    measured, expected = made_deflections(sign, force, moment)
    reported = find_wrong_loads(measured, expected)
    assert bool(reported) == (sign < 0 or bool(phrase))
    assert decode_load_faults(reported) == pytest.approx((sign, force, moment))
    for fault in reported:
        # Forces and moments deflect alike here, so that the slope is the mean of their
        # factors.
        slope = sign * (force + moment) / 2
        assert fault.parameters[-1].value == pytest.approx(
            slope, rel=0.01 if force == moment else 0.1
        )
        # Of what robots have in common, 1/1.7 to 1.7, the factor that leaves least.
        residual = measured - np.linspace(1 / 1.7, 1.7, 2001)[:, None] * expected.sum(
            axis=1
        )
        assert fault.evidence[0] == pytest.approx(
            np.sqrt((residual**2).mean(axis=1)).min(), rel=0.02
        )
        assert fault.evidence[1] < 0.1 * fault.evidence[0]


@pytest.mark.parametrize(
    "ratios",
    [
        1.0,
        0.5,
        2.0,
        3.0,
        9.8 * np.array([1.0, 3.0, 0.4, 1.0, 2.5, 0.5]),
        9.8 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0]),
    ],
    ids=str,
)
def test_no_unit_is_found_for_compliances_that_are_only_off(ratios):
    assert find_wrong_loads(*made_deflections(ratios=ratios)) == []


def test_of_equivalent_units_the_one_with_compliances_closest_to_nominal_is_named_first():
    # 1.4 times pounds-force are 0.63 times kilogram-force, and 1.55 times 0.70.
    (fault,) = find_wrong_loads(
        *made_deflections(force=POUND, moment=POUND, ratios=1.4)
    )
    assert fault.detail.startswith("the loads look like pounds-force")
    assert [
        alternative.startswith("the loads look like kilogram-force")
        for alternative in fault.alternatives
    ] == [True]
    (fault,) = find_wrong_loads(
        *made_deflections(force=POUND, moment=POUND, ratios=1.55)
    )
    assert (
        fault.detail.startswith("the loads look like kilogram-force")
        and fault.alternatives
    )
    (fault,) = find_wrong_loads(*made_deflections(force=KILOGRAM, moment=KILOGRAM))
    assert not fault.alternatives


@pytest.fixture(scope="module", params=["base", "tracker"])
def loaded(request, fanuc):
    return make_campaign(
        fanuc,
        2,
        Plan(poses=20, tracker=request.param == "tracker"),
        change_compliances(fanuc, 1, 0.3),
    )


@pytest.mark.parametrize(
    "factor",
    [
        (KILOGRAM, KILOGRAM),
        (1e3, 1e3),
        (1e-3, 1e-3),
        (1 / POUND, 1 / POUND),
        (1.0, 1e-3),
    ],
)
def test_loads_in_another_unit_are_named_with_its_factor(loaded, factor):
    written = loaded.measurements.wrench / np.repeat(factor, 3)
    (fault,) = find_wrong_loads(
        *compute_deflections(replace_measured_columns(loaded, wrench=written))
    )
    assert (fault.name, fault.joints) == ("wrong_unit", ())
    assert [value.value for value in fault.parameters[:2]] == pytest.approx(factor)
    assert fault.evidence[1] < 0.5 * fault.evidence[0]


def test_loads_turned_round_are_named(loaded):
    (fault,) = find_wrong_loads(
        *compute_deflections(
            replace_measured_columns(loaded, wrench=-loaded.measurements.wrench)
        )
    )
    assert (fault.name, fault.joints) == ("wrong_sign", ()) and "loads" in fault.detail
    assert -2.0 < fault.parameters[0].value < -0.5
