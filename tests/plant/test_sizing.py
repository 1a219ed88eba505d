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
    yardstick, fanuc_specimen, kind, quantity, target
):
    joints = () if kind.startswith("outside") else (2,)
    defect = replace(draw_defect(kind, fanuc_specimen.arm, 3), joints=joints)

    def robot_of_size(size):
        return apply_defects(fanuc_specimen, [replace(defect, size=size)])

    size = find_size(
        yardstick, robot_of_size, defect.size, target, quantity, KINDS[kind].largest
    )
    assert yardstick.compute_noncentralities(robot_of_size(size))[
        quantity
    ] == pytest.approx(target, rel=0.011)


def test_a_wrong_force_scale_is_absorbed_at_any_size_but_for_what_the_weights_tell(
    weightless, fanuc_specimen, schedule
):
    def scaled(robot):
        return lambda size: apply_defects(robot, [Defect("force_scale", (), size)])

    with pytest.raises(ValueError, match="no size found"):
        find_size(
            NoncentralityModel(weightless, schedule),
            scaled(weightless),
            0.02,
            50.0,
            largest=KINDS["force_scale"].largest,
        )
    yardstick = NoncentralityModel(
        fanuc_specimen, schedule, declared=fanuc_specimen.arm.masses
    )
    with pytest.raises(ValueError, match="no size found"):
        find_size(
            yardstick,
            scaled(fanuc_specimen),
            0.02,
            50.0,
            largest=KINDS["force_scale"].largest,
        )
    # Weights that are known without error would tell the compliances, and these the
    # scale; by poses enough.
    longer = draw_schedule(fanuc_specimen.arm, Design(poses=20), 2)
    exact, open_weights = (
        NoncentralityModel(
            fanuc_specimen, longer, declared=masses
        ).compute_noncentralities(scaled(fanuc_specimen)(0.02))["retained"]
        for masses in ((), fanuc_specimen.arm.masses)
    )
    assert exact > 100 * open_weights


def test_weights_that_differ_as_declared_are_absorbed_up_to_their_own_cost(
    fanuc_specimen, schedule
):
    """A mass that is two standard deviations off: four, or two where a centre one off
    and a mass one off do the same."""
    arm = fanuc_specimen.arm
    declared = arm.masses
    heavier = replace(declared[2], mass_kg=declared[2].mass_kg * 1.2)
    nominal, off = (
        replace(
            fanuc_specimen, structure=replace(fanuc_specimen.structure, masses=masses)
        )
        for masses in (declared, (*declared[:2], heavier, *declared[3:]))
    )
    signal = NoncentralityModel(
        nominal, schedule, declared=declared
    ).compute_noncentralities(off)
    assert 0.5 < signal["retained"] < 2.0 < 0.01 * signal["raw"]
    # Where this link's weight alone is open, by poses enough. The shoulder feels its
    # mass times its lever; the elbow does not.
    longer = draw_schedule(arm, Design(poses=20), 2)
    assert NoncentralityModel(
        nominal, longer, declared=declared[2:3]
    ).compute_noncentralities(off)["retained"] == pytest.approx(2.0, rel=0.02)


def test_the_retained_signal_is_what_a_fit_of_the_compliances_leaves(
    fanuc_specimen, schedule
):
    """By a least-squares fit of the plant's own compliances to the defective
    measurements."""
    defect = Defect("lost_motion", (2,), 7e-5, 3)
    yardstick = NoncentralityModel(fanuc_specimen, schedule)
    bad = apply_defects(fanuc_specimen, [defect])
    seen = yardstick.project_change(bad)[0]
    columns = []
    for joint in range(6):
        softer = fanuc_specimen.compliance * (1 + 0.01 * (np.arange(6) == joint))
        columns.append(
            yardstick.project_change(replace(fanuc_specimen, compliance=softer))[0]
        )
    left = (
        seen
        - np.array(columns).T
        @ np.linalg.lstsq(np.array(columns).T, seen, rcond=None)[0]
    )
    assert yardstick.compute_noncentralities(bad)["retained"] == pytest.approx(
        left @ left, rel=1e-3
    )


def shifted(robot, shift, turn):
    """All that the tracker reads is moved as one body."""
    return replace(robot, tracker=replace(robot.tracker, move=Motion(shift, turn)))


def test_a_tracker_farther_away_makes_the_same_shift_weigh_less(weightless, schedule):
    tracker = replace(weightless.tracker, sigma_m=0.0, sigma_m_per_m=1e-5)
    robot = replace(weightless, tracker=tracker)
    yardstick = NoncentralityModel(robot, schedule)
    change = yardstick.project_change(
        shifted(robot, (1e-4, 0.0, 0.0), (0.0, 0.0, 0.0))
    )[0]
    change = change.reshape(-1, len(robot.arm.points), 6)[..., 0]
    distance = np.linalg.norm(yardstick.poses[0] - np.array(tracker.stand_m), axis=-1)
    np.testing.assert_allclose(change, 10.0 / distance[schedule.training])


def test_a_free_frame_absorbs_any_motion_as_one_body_and_a_known_one_does_not(
    weightless, schedule
):
    bad = shifted(weightless, (1e-4, -2e-4, 5e-5), (2e-5, 1e-5, -3e-5))
    free, known = (
        NoncentralityModel(
            weightless, schedule, free_frame=free
        ).compute_noncentralities(bad)
        for free in (True, False)
    )
    assert free["raw"] == pytest.approx(known["raw"])
    # To second order of a turn of 40 urad at some metres.
    assert free["retained"] < 1e-6 * free["raw"]
    assert known["retained"] > 0.5 * known["raw"]
