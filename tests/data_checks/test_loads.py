"""Deflections beside what loads should have made of them: units and signs are named, compliances that are only off are not."""

from dataclasses import replace

import numpy as np
import pytest
from made_campaigns import POINTS, Plan, made, with_other_compliances
from support import PinocchioPoint

from elastocal.data_checks.loads import (
    Deflections,
    deflections,
    find,
    unit_of_loads,
)

EXACT = Plan(poses=6, loads=2, noise=0.0)
JOINTS = 6


@pytest.fixture(scope="module")
def campaign(fanuc):
    return made(fanuc, 1, EXACT)


def expected_parts(robot, seen, part):
    """Deflection of each target by each joint at nominal compliance from forces or moments alone, ndarray (N, 3, n)."""
    end = PinocchioPoint(robot.chain, robot.chain.end_effector)
    points = [PinocchioPoint(robot.chain, robot.chain.point(name)) for name in POINTS]
    parts = []
    for q, wrench, target in zip(seen.joint_angles, seen.wrench, seen.target, strict=True):
        torques = end.pose_and_jacobian(q)[2][part].T @ wrench[part]
        parts.append(points[target].pose_and_jacobian(q)[2][:3] * torques * robot.compliance)
    return np.array(parts)


def less_group_means(values, *keys):
    group = np.unique(np.column_stack(keys), axis=0, return_inverse=True)[1].ravel()
    return np.array([value - values[group == number].mean(axis=0) for value, number in zip(values, group, strict=True)])


def test_deflections_are_those_of_each_joint_by_pinocchio_less_the_mean_of_target_and_pose(fanuc, campaign):
    seen = campaign.measurements
    found = deflections(campaign, seen)
    assert found.poses == 6 and found.seen.shape == (3 * len(seen),)
    for by, part in ((found.by_force, slice(0, 3)), (found.by_moment, slice(3, 6))):
        expected = less_group_means(expected_parts(fanuc, seen, part), seen.pose, seen.target)
        np.testing.assert_allclose(by.reshape(-1, 3, JOINTS), expected, rtol=0, atol=1e-12)
    # Second order in turns of some milliradians over metres.
    np.testing.assert_allclose(found.seen, (found.by_force + found.by_moment).sum(axis=1), rtol=0, atol=2e-4)
    assert np.abs(found.seen).max() > 1e-3


@pytest.mark.parametrize("loaded_only", [False, True])
def test_joints_off_their_zeros_leave_no_trace_in_the_deflections(fanuc, loaded_only):
    """As means of a pose, or by projection where each pose has one load."""
    plan = Plan(poses=40, loads=1, noise=0.0)
    straight, off = (made(fanuc, 1, plan, true_offset=offset) for offset in (0.0, 2e-3 * np.array([1, -1, 1, -1, 1, -1])))
    kept = straight.measurements.load >= loaded_only
    assert np.linalg.norm(off.measurements.position - straight.measurements.position, axis=1).max() > 3e-3
    one, other = (deflections(each, each.measurements.select(kept)) for each in (straight, off))
    # What is left is of second order: two milliradians of every deflection.
    assert np.abs(other.seen - one.seen).max() < 0.02 * np.abs(one.seen).max()


def test_where_a_pose_has_one_load_nothing_that_joint_offsets_make_is_left(fanuc):
    plan = Plan(poses=30, loads=1, noise=0.0)
    campaign = made(fanuc, 1, plan)
    seen = campaign.measurements.select(campaign.measurements.load > 0)
    found = deflections(campaign, seen)
    points = [PinocchioPoint(fanuc.chain, fanuc.chain.point(name)) for name in POINTS]
    pairs = zip(seen.joint_angles, seen.target, strict=True)
    offsets = np.concatenate([points[target].pose_and_jacobian(q)[2][:3] for q, target in pairs])
    for values in (found.seen[:, None], found.by_force, found.by_moment):
        size = np.linalg.norm(values) * np.linalg.norm(offsets)
        np.testing.assert_allclose(offsets.T @ values / size, 0.0, atol=1e-12)
    # Lovell: what the rest tells of the compliances is what all columns together tell.
    whole = np.concatenate([expected_parts(fanuc, seen, slice(0, 6)).reshape(-1, JOINTS), offsets], axis=1)
    pairs = zip(seen.joint_angles, seen.target, strict=True)
    nominal = np.concatenate([points[target].pose_and_jacobian(q)[0] for q, target in pairs])
    together = np.linalg.lstsq(whole, seen.position.ravel() - nominal, rcond=None)[0][:JOINTS]
    alone = np.linalg.lstsq(found.by_force + found.by_moment, found.seen, rcond=None)[0]
    np.testing.assert_allclose(alone, together, rtol=1e-6, atol=1e-9)


def test_nothing_is_said_without_loads_or_with_too_few_poses(campaign):
    seen = campaign.measurements
    assert deflections(campaign, replace(seen, wrench=0.0 * seen.wrench)) is None
    assert deflections(campaign, seen.select(seen.pose < 3)) is None
    assert deflections(campaign, seen.select(seen.pose < 4)) is not None


def made_deflections(sign=1.0, force=1.0, moment=1.0, ratios=1.0, noise=1e-5, seed=1):
    """Forces and moments that deflect alike, seen as loads in another unit make them seen."""
    rng = np.random.default_rng(seed)
    by_force, by_moment = 1e-3 * rng.standard_normal((2, 450, JOINTS))
    made_by = force * by_force + moment * by_moment
    scale = np.abs(made_by).max()
    seen = sign * made_by @ (ratios * np.ones(JOINTS)) + noise * scale / 1e-3 * rng.standard_normal(450)
    return Deflections(seen, by_force, by_moment, 75)


KILOGRAM, POUND = 9.80665, 4.4482216152605
# Newtons for each unit of force written, newton metres for each unit of moment, and a word of the sentence.
FACTORS = [
    (1.0, 1.0, ""),
    (KILOGRAM, KILOGRAM, "loads look like kilogram-force"),
    (1 / KILOGRAM, 1 / KILOGRAM, "over 9.81"),
    (1e3, 1e3, "loads look like kilonewtons"),
    (1e-3, 1e-3, "loads look like millinewtons"),
    (POUND, POUND, "loads look like pounds-force"),
    (1 / POUND, 1 / POUND, "over 4.45"),
    (1.0, 1e-3, "moments look like newton millimetres"),
    (1e3, 1.0, "forces look like kilonewtons"),
    (KILOGRAM, 1.0, "forces look like kilogram-force"),
]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("force", "moment", "words"), FACTORS)
def test_every_unit_and_sign_is_found_by_what_it_makes_of_the_deflections(sign, force, moment, words):
    deflected = made_deflections(sign, force, moment)
    found = unit_of_loads(deflected)
    if sign > 0 and not words:
        # Newtons and newton metres as they should be.
        assert found is None
        return
    assert (found.sign, found.unit.force, found.unit.moment) == (sign, pytest.approx(force), pytest.approx(moment))
    assert words in found.unit.detail and bool(words) == bool(found.unit.detail)
    # Forces and moments deflect alike here, so that the slope is the mean of their factors.
    alike = force == moment
    assert found.slope == pytest.approx(sign * (force + moment) / 2, rel=0.01 if alike else 0.1)
    as_written = (deflected.by_force + deflected.by_moment).sum(axis=1)
    # Of what robots have in common, 1/1.7 to 1.7, the factor that leaves least.
    allowed = np.linspace(1 / 1.7, 1.7, 2001)[:, None]
    least = np.sqrt(((deflected.seen - allowed * as_written) ** 2).mean(axis=1)).min()
    assert found.rms_as_written == pytest.approx(least, rel=0.02)
    assert found.rms_corrected < 0.1 * found.rms_as_written


@pytest.mark.parametrize(
    "ratios",
    [1.0, 0.5, 2.0, 3.0, 9.8 * np.array([1.0, 3.0, 0.4, 1.0, 2.5, 0.5]), 9.8 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])],
    ids=str,
)
def test_no_unit_is_found_for_compliances_that_are_only_off(ratios):
    assert unit_of_loads(made_deflections(ratios=ratios)) is None


BENDING = 1.6 * np.array([1.05, 1.2, 0.8, 1.1, 0.9, 1.0])


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("force", "moment", "words"), FACTORS)
def test_what_yields_beside_the_joints_does_not_hide_the_unit(sign, force, moment, words):
    found = unit_of_loads(made_deflections(sign, force, moment, BENDING))
    if sign > 0 and words in ("", "over 4.45"):
        # 1.6 / 4.45 is a robot that is stiffer than its data sheet.
        assert found is None
        return
    named = [unit for unit in (found.unit, found.less_likely) if unit is not None]
    assert found.sign == sign and (force, moment) in [(pytest.approx(u.force), pytest.approx(u.moment)) for u in named]


def test_of_two_units_within_reach_the_one_by_which_compliances_are_nearest_nominal_is_named_first():
    # 1.4 times pounds-force are 0.63 times kilogram-force, and 1.55 times 0.70.
    found = unit_of_loads(made_deflections(force=POUND, moment=POUND, ratios=1.4))
    assert [found.unit.force, found.less_likely.force] == [pytest.approx(POUND), KILOGRAM]
    found = unit_of_loads(made_deflections(force=POUND, moment=POUND, ratios=1.55))
    assert [found.unit.force, found.less_likely.force] == [KILOGRAM, pytest.approx(POUND)]
    assert unit_of_loads(made_deflections(force=KILOGRAM, moment=KILOGRAM)).less_likely is None


@pytest.fixture(scope="module", params=["base", "tracker"])
def loaded(request, fanuc):
    return made(fanuc, 2, Plan(poses=20, tracker=request.param == "tracker"), with_other_compliances(fanuc, 1, 0.3))


def scaled(measurements, force, moment):
    return replace(measurements, wrench=measurements.wrench * np.repeat([force, moment], 3))


@pytest.mark.parametrize("factor", [KILOGRAM, 1 / KILOGRAM, 1e3, 1e-3, POUND, 1 / POUND])
def test_loads_in_another_unit_are_named_with_its_factor(loaded, factor):
    (fault,) = find(loaded, scaled(loaded.measurements, 1 / factor, 1 / factor))
    assert (fault.name, fault.joints, fault.decisive) == ("wrong_unit", (), True)
    force, moment, slope = fault.parameters
    assert force.value == pytest.approx(factor, rel=1e-3)
    assert moment.value == force.value
    assert slope.value == pytest.approx(factor, rel=0.4)
    assert fault.evidence[1] < 0.5 * fault.evidence[0]


def test_without_known_compliances_no_unit_is_named(loaded):
    unknown = replace(loaded, robot=replace(loaded.robot, compliance_known=False))
    assert find(unknown, scaled(loaded.measurements, 1e-3, 1e-3)) == []


def test_the_sentence_names_what_is_less_likely_too(fanuc):
    loaded = made(fanuc, 2, Plan(poses=20), replace(fanuc, compliance=1.4 * fanuc.compliance))
    (fault,) = find(loaded, scaled(loaded.measurements, 1 / POUND, 1 / POUND))
    assert fault.detail.startswith("the loads look like pounds-force")
    assert "; less likely, the loads look like kilogram-force: measurements fit 9.81 times" in fault.detail


@pytest.mark.parametrize(("force", "moment"), [(1.0, 1e-3), (1e3, 1.0), (KILOGRAM, 1.0)])
def test_forces_and_moments_in_units_that_do_not_match_are_named(loaded, force, moment):
    (fault,) = find(loaded, scaled(loaded.measurements, 1 / force, 1 / moment))
    assert [value.value for value in fault.parameters[:2]] == [force, moment]


def test_a_unit_is_named_without_unloaded_measurements(fanuc):
    loaded = made(fanuc, 5, Plan(poses=40, loads=1, tracker=True, oriented=False))
    measurements = loaded.measurements.select(loaded.measurements.load > 0)
    (fault,) = find(loaded, scaled(measurements, 1 / KILOGRAM, 1 / KILOGRAM))
    assert fault.parameters[0].value == KILOGRAM


def test_loads_turned_round_are_named(loaded):
    (fault,) = find(loaded, replace(loaded.measurements, wrench=-loaded.measurements.wrench))
    assert fault.joints == ()
    assert "loads" in fault.detail
    assert -2.0 < fault.parameters[0].value < -0.5


def test_loads_turned_round_are_named_without_unloaded_measurements(fanuc):
    loaded = made(fanuc, 5, Plan(poses=40, loads=1, tracker=True, oriented=False))
    measurements = loaded.measurements.select(loaded.measurements.load > 0)
    assert find(loaded, measurements) == []
    (fault,) = find(loaded, replace(measurements, wrench=-measurements.wrench))
    assert "loads" in fault.detail
