"""Non-centralities of defects, and the sizes that have them."""

from dataclasses import replace

import numpy as np
import pytest

from elastocal.plant.defects import KINDS, Defect, drawn_defect, with_defects
from elastocal.plant.sizing import Yardstick, size_for
from elastocal.plant.weights import declared_masses, on_stretches


@pytest.mark.parametrize("target", [10.0, 200.0])
@pytest.mark.parametrize("quantity", ["raw", "retained"])
@pytest.mark.parametrize("kind", ["joint_offset", "stiffening", "link_elasticity", "outside:foot_slip"])
def test_a_defect_is_sized_to_its_non_centrality(yardstick, fanuc_specimen, kind, quantity, target):
    defect = replace(drawn_defect(kind, fanuc_specimen.arm, 3), joints={"stiffening": (2,)}.get(kind, (2,)))
    defect = replace(defect, joints=defect.joints if defect.joints in KINDS[kind].locations(fanuc_specimen.arm) else ())

    def robot_of_size(size):
        return with_defects(fanuc_specimen, [replace(defect, size=size)])

    size, signal = size_for(yardstick, robot_of_size, defect.size, target, quantity, KINDS[kind].largest)
    assert getattr(signal, quantity) == pytest.approx(target, rel=0.011)
    assert getattr(yardstick.signal(robot_of_size(size)), quantity) == pytest.approx(target, rel=0.011)


def test_a_wrong_force_scale_is_absorbed_at_any_size_but_for_what_the_weights_tell(weightless, fanuc_specimen, schedule):
    def scaled(robot):
        return lambda size: with_defects(robot, [Defect("force_scale", (), size)])

    with pytest.raises(ValueError, match="no size found"):
        size_for(Yardstick(weightless, schedule), scaled(weightless), 0.02, 50.0)
    yardstick = Yardstick(fanuc_specimen, schedule, declared=declared_masses(fanuc_specimen.arm))
    with pytest.raises(ValueError, match="no size found"):
        size_for(yardstick, scaled(fanuc_specimen), 0.02, 50.0, largest=KINDS["force_scale"].largest)
    # Weights that are known without error would tell the compliances, and these the scale.
    exact = Yardstick(fanuc_specimen, schedule).signal(scaled(fanuc_specimen)(0.02)).retained
    assert exact > 100 * yardstick.signal(scaled(fanuc_specimen)(0.02)).retained


def test_weights_that_differ_as_declared_are_absorbed_up_to_their_own_cost(fanuc_specimen, schedule):
    """A mass that is two standard deviations off: four, or two where a centre one off and a mass one off do the same."""
    arm = fanuc_specimen.arm
    declared = declared_masses(arm)
    heavier = replace(declared[2], mass_kg=declared[2].mass_kg * 1.2)
    nominal, off = (
        replace(fanuc_specimen, structure=replace(fanuc_specimen.structure, masses=on_stretches(masses, arm)))
        for masses in (declared, (*declared[:2], heavier, *declared[3:]))
    )
    signal = Yardstick(nominal, schedule, declared=declared).signal(off)
    assert 0.5 < signal.retained < 2.0 < 0.01 * signal.raw
    # Where this link's weight alone is open. The shoulder feels its mass times its lever; the elbow does not.
    assert Yardstick(nominal, schedule, declared=declared[2:3]).signal(off).retained == pytest.approx(2.0, rel=0.02)


def test_the_retained_signal_is_what_a_fit_of_the_compliances_leaves(fanuc_specimen, schedule):
    """By a least-squares fit of the plant's own compliances to the defective measurements."""
    defect = Defect("lost_motion", (2,), 7e-5, 3)
    yardstick = Yardstick(fanuc_specimen, schedule)
    bad = with_defects(fanuc_specimen, [defect])
    seen, columns = yardstick.change(bad)[schedule.training].ravel(), []
    for joint in range(6):
        softer = fanuc_specimen.compliance * (1 + 0.01 * (np.arange(6) == joint))
        columns.append(yardstick.change(replace(fanuc_specimen, compliance=softer))[schedule.training].ravel())
    left = seen - np.array(columns).T @ np.linalg.lstsq(np.array(columns).T, seen, rcond=None)[0]
    assert yardstick.signal(bad).retained == pytest.approx(left @ left, rel=1e-3)


def test_a_defect_that_these_poses_do_not_show_adds_no_direction_to_the_angle(yardstick, fanuc_specimen):
    """A gear that stiffens at a torque that no load reaches leaves nothing to compare with."""
    wave, runout = (
        with_defects(fanuc_specimen, [Defect(k, (2,), 1e-4, 1)]) for k in ("transmission_harmonic", "bearing_runout")
    )
    assert yardstick.angle_deg(wave, [fanuc_specimen]) == 90.0
    assert yardstick.angle_deg(wave, [fanuc_specimen, runout]) == yardstick.angle_deg(wave, [runout]) < 90.0
