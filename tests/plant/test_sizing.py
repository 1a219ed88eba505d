"""Non-centralities of defects, and the sizes that have them."""

from dataclasses import replace

import numpy as np
import pytest

from elastocal_proof.blind.cases import find_size
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.kinds import KINDS, Defect, apply_defects, draw_defect
from elastocal_proof.plant.simulated_robot import Motion
from elastocal_proof.plant.sizing import NoncentralityModel


@pytest.mark.parametrize("target", [10.0, 200.0])
@pytest.mark.parametrize("quantity", ["raw", "retained"])
@pytest.mark.parametrize(
    "kind", ["joint_offset", "stiffening", "link_elasticity", "outside:foot_slip"]
)
def test_a_defect_is_sized_to_its_non_centrality(
    noncentrality, fanuc_specimen, kind, quantity, target
):
    joints = () if kind.startswith("outside") else (2,)
    defect = replace(draw_defect(kind, fanuc_specimen.arm, 3), joints=joints)

    def make_robot(size):
        return apply_defects(fanuc_specimen, [replace(defect, size=size)])

    size = find_size(
        noncentrality, make_robot, defect.size, target, quantity, KINDS[kind].largest
    )
    signal = noncentrality.compute_noncentralities(make_robot(size))
    assert signal[quantity] == pytest.approx(target, rel=0.011)


def scale_force(robot):
    """Robots by the size of their cell's scale error."""
    return lambda size: apply_defects(robot, [Defect("force_scale", (), size)])


@pytest.mark.parametrize("weighs", [False, True])
def test_a_wrong_force_scale_of_any_size_is_absorbed(
    weightless_specimen, fanuc_specimen, schedule, weighs
):
    robot = fanuc_specimen if weighs else weightless_specimen
    declared = robot.arm.masses if weighs else ()
    with pytest.raises(ValueError, match="no size found"):
        find_size(
            NoncentralityModel(robot, schedule, declared=declared),
            scale_force(robot),
            0.02,
            50.0,
            largest=KINDS["force_scale"].largest,
        )


def test_exactly_known_weights_reveal_a_wrong_force_scale(fanuc_specimen):
    """They identify the compliances, and these the scale, if there are enough poses."""
    schedule = draw_schedule(fanuc_specimen.arm, Design(poses=20), 2)
    defective = scale_force(fanuc_specimen)(0.02)
    with_exact_weights = NoncentralityModel(fanuc_specimen, schedule)
    with_uncertain_weights = NoncentralityModel(
        fanuc_specimen, schedule, declared=fanuc_specimen.arm.masses
    )
    exact, uncertain = (
        model.compute_noncentralities(defective)["retained"]
        for model in (with_exact_weights, with_uncertain_weights)
    )
    assert exact > 100 * uncertain


def test_weights_that_deviate_as_declared_are_absorbed_up_to_their_prior_term(
    fanuc_specimen, schedule
):
    """A mass deviates by two standard deviations. Its prior term is four, or two if a
    centre and a mass that deviate by one each have the same effect."""
    arm = fanuc_specimen.arm
    declared = arm.masses
    heavy_link = replace(declared[2], mass_kg=declared[2].mass_kg * 1.2)
    nominal, heavier = (
        replace(
            fanuc_specimen, structure=replace(fanuc_specimen.structure, masses=masses)
        )
        for masses in (declared, (*declared[:2], heavy_link, *declared[3:]))
    )
    model = NoncentralityModel(nominal, schedule, declared=declared)
    signal = model.compute_noncentralities(heavier)
    assert 0.5 < signal["retained"] < 2.0 < 0.01 * signal["raw"]
    # The same if only this link's weight is uncertain and there are enough poses. The
    # shoulder carries its mass times its lever; the elbow does not.
    longer = draw_schedule(arm, Design(poses=20), 2)
    model = NoncentralityModel(nominal, longer, declared=declared[2:3])
    signal = model.compute_noncentralities(heavier)
    assert signal["retained"] == pytest.approx(2.0, rel=0.02)


def test_the_retained_signal_is_the_residual_of_a_fit_of_the_compliances(
    fanuc_specimen, schedule
):
    """A least-squares fit of the robot's compliances to the defective measurements."""
    defect = Defect("lost_motion", (2,), 7e-5, 3)
    model = NoncentralityModel(fanuc_specimen, schedule)
    defective = apply_defects(fanuc_specimen, [defect])
    change = model.compute_change(defective)
    columns = []
    for joint in range(6):
        softer = fanuc_specimen.compliance * (1 + 0.01 * (np.arange(6) == joint))
        robot = replace(fanuc_specimen, compliance=softer)
        columns.append(model.compute_change(robot))
    design = np.array(columns).T
    residual = change - design @ np.linalg.lstsq(design, change, rcond=None)[0]
    signal = model.compute_noncentralities(defective)
    assert signal["retained"] == pytest.approx(residual @ residual, rel=1e-3)


def move_stand(robot, shift, turn):
    """Move all readings of the tracker as one body."""
    return replace(robot, tracker=replace(robot.tracker, move=Motion(shift, turn)))


def test_a_shift_is_less_visible_to_a_tracker_that_stands_farther_away(
    weightless_specimen, schedule
):
    tracker = replace(weightless_specimen.tracker, sigma_m=0.0, sigma_m_per_m=1e-5)
    robot = replace(weightless_specimen, tracker=tracker)
    model = NoncentralityModel(robot, schedule)
    moved = move_stand(robot, (1e-4, 0.0, 0.0), (0.0, 0.0, 0.0))
    change = model.compute_change(moved)
    change_of_x = change.reshape(-1, len(robot.arm.points), 6)[..., 0]
    distance = np.linalg.norm(model.poses[0] - np.array(tracker.stand_m), axis=-1)
    np.testing.assert_allclose(change_of_x, 10.0 / distance[schedule.training])


def test_a_free_frame_absorbs_any_rigid_motion_and_a_known_frame_does_not(
    weightless_specimen, schedule
):
    moved = move_stand(weightless_specimen, (1e-4, -2e-4, 5e-5), (2e-5, 1e-5, -3e-5))
    free_frame, known_frame = (
        NoncentralityModel(
            weightless_specimen, schedule, free_frame=free
        ).compute_noncentralities(moved)
        for free in (True, False)
    )
    assert free_frame["raw"] == pytest.approx(known_frame["raw"])
    # The second order of a rotation by 40 urad at some metres remains.
    assert free_frame["retained"] < 1e-6 * free_frame["raw"]
    assert known_frame["retained"] > 0.5 * known_frame["raw"]
