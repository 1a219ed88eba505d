"""Each law of a gear or a drive, as a machine has it and not as the catalogue writes it."""

from dataclasses import replace

import numpy as np
import pytest

from elastocal_proof.plant.campaigns import Design, schedule_of
from elastocal_proof.plant.catalogued import wound
from elastocal_proof.plant.defects import Defect, with_defects

JOINT = 1


@pytest.fixture(scope="module")
def done(fanuc_arm):
    return schedule_of(fanuc_arm, Design(poses=40, ladder=(0.0, 1.0), repeats=1), 3)


@pytest.fixture
def turns(weightless, done):
    """What the gear of joint 2 turns by under torques on it, by a defect there; torques on other joints are none."""

    def of(kind, size, torque, seed=1, joints=(JOINT + 1,), unloaded=0.0, **changes):
        robot = with_defects(weightless, [Defect(kind, joints, size, seed)])
        torque = np.broadcast_to(torque, len(done.pose))
        given = np.zeros((2, len(done.pose), robot.arm.joints))
        given[0, :, JOINT], given[1, :, JOINT] = torque, unloaded
        joint, law = robot.gears[-1]
        assert joint == joints[0] - 1
        return law(replace(done, **changes), *given)

    return of


def drive(robot, defect, done):
    (_, law) = with_defects(robot, [defect]).drives[-1]
    return law(done)


@pytest.mark.parametrize("seed", range(3))
def test_a_closed_gap_adds_half_the_play_whatever_the_torque_and_an_open_one_nothing_abrupt(turns, seed):
    np.testing.assert_allclose(turns("lost_motion", 1e-4, 1e5, seed), 1e-4)
    np.testing.assert_allclose(turns("lost_motion", 1e-4, -1e4, seed), -1e-4)
    # 2 to 10 % of the usual 1500 N m close it.
    small = turns("lost_motion", 1e-4, np.linspace(0.0, 25.0, 80), seed)
    assert small[0] == 0 and (np.diff(small) > 0).all() and np.abs(np.diff(small, 2)).max() < 1e-12


def test_stiffening_is_none_at_small_torques_odd_and_takes_its_share_of_the_compliance_at_large_ones(turns, weightless):
    compliance = weightless.compliance[JOINT]
    torque = np.linspace(0.0, 3000.0, 80)
    up, down = turns("stiffening", 0.3, torque), turns("stiffening", 0.3, -torque)
    np.testing.assert_allclose(up, -down)
    slope = np.diff(up) / np.diff(torque)
    assert slope[0] == 0 and slope[-1] == pytest.approx(-0.3 * compliance)
    assert len(np.unique(np.round(slope / compliance, 3))) in range(4, 8)


@pytest.mark.parametrize("kind", ["joint_dependent_stiffness", "outside:foreign_angle_stiffness"])
def test_stiffness_follows_the_angle_of_its_own_or_another_joint(turns, weightless, done, kind):
    of = JOINT if kind == "joint_dependent_stiffness" else 2
    turn = turns(kind, 0.2, 100.0)
    stiffness = 1.0 / (1.0 + turn / (100.0 * weightless.compliance[JOINT])) - 1.0
    waves = np.column_stack([np.cos(done.angle[:, of]), np.sin(done.angle[:, of])])
    found, left = np.linalg.lstsq(waves, stiffness)[:2]
    assert np.linalg.norm(found) == pytest.approx(0.2) and left < 1e-20


def test_a_compensators_stiffness_is_the_second_derivative_of_its_energy(weightless, done):
    compliance, size = weightless.compliance[JOINT], 1e6
    # By the details that its seed draws: two arms, the free length, and where both arms point the same way.
    anchor, crank, free, zero = (0.4, 0.2, 0.25, 0.3)

    class Details:
        drawn = iter((anchor, crank, free, zero))

        def uniform(self, low, high):
            return next(self.drawn)

    from elastocal_proof.plant.kinds import KINDS

    robot, _ = KINDS["compensator_stiffness"].apply(weightless, size, Details(), JOINT)
    angle, step = done.angle[:, JOINT], 1e-4

    def energy(q):
        return 0.5 * size * (np.sqrt(anchor**2 + crank**2 - 2 * anchor * crank * np.cos(q - zero)) - free) ** 2

    stiffness = (energy(angle + step) - 2 * energy(angle) + energy(angle - step)) / step**2
    torque = np.full((len(angle), 6), 1000.0)
    wanted = 1000.0 * (1.0 / (1.0 / compliance + stiffness) - compliance)
    np.testing.assert_allclose(robot.gears[-1][1](done, torque, 0 * torque), wanted, rtol=1e-4)


def test_coupled_gears_turn_each_other_alike(weightless, done):
    robot, torque = with_defects(weightless, [Defect("cross_compliance", (2, 3), 1e-7, 1)]), np.zeros((len(done.pose), 6))
    torque[:, 1], torque[:, 2] = 100.0, 50.0
    (one, first), (other, second) = robot.gears
    assert (one, other) == (1, 2)
    sign = np.sign(first(done, torque, torque)[0])
    np.testing.assert_allclose(first(done, torque, torque), sign * 5e-6)
    np.testing.assert_allclose(second(done, torque, torque), sign * 1e-5)


def test_friction_keeps_an_arm_behind_its_approach_until_a_load_against_it_turns_it_round(turns, done):
    behind = -5e-5 * done.sense[:, JOINT]
    np.testing.assert_allclose(turns("hysteresis", 5e-5, 0.0), behind)
    # What weight has wound up before the load is no part of the history.
    np.testing.assert_allclose(turns("hysteresis", 5e-5, -900.0, unloaded=-900.0), behind)
    np.testing.assert_allclose(turns("hysteresis", 5e-5, 1e5 * done.sense[:, JOINT]), behind, rtol=1e-3)
    np.testing.assert_allclose(turns("hysteresis", 5e-5, -1e5 * done.sense[:, JOINT]), -behind, rtol=2e-2)


def test_a_ladder_without_a_move_carries_its_history_along(turns, done):
    torque = np.zeros(len(done.pose))
    torque[:3] = [0.0, -8000.0, -4000.0]
    chained = np.full(len(done.pose), -1)
    chained[1:3] = [0, 1]
    came = np.ones_like(done.sense)
    fresh = turns("hysteresis", 1.0, torque, sense=came)
    late = turns("hysteresis", 1.0, torque, sense=came, previous=chained)
    # Half the load, reached from none and from the whole.
    assert abs(fresh[2] - late[2]) > 0.02
    np.testing.assert_allclose(fresh[:2], late[:2])


def test_hysteresis_goes_round_a_closed_loop_that_takes_energy_however_finely_loads_are_split():
    z, path = np.array([0.0]), []
    for change in (500.0, *(-1000.0, 1000.0) * 3):
        z = wound(z, np.array([change]) / 300.0)
        path.append(float(z[0]))
    assert path[2] == pytest.approx(path[4], abs=1e-3)
    up, down = (-wound(np.array([path[end]]), np.array([change]) / 300.0) for end, change in ((1, 500.0), (2, -500.0)))
    assert down - up > 0.3
    # Unloading starts along the straight line of slope 1.
    np.testing.assert_allclose(wound(np.array([0.5, -0.5]), np.array([-0.3, 0.3])), [0.2, -0.2], atol=1e-12)
    halves = wound(wound(np.array([1.0]), np.array([-0.7])), np.array([-0.7]))
    np.testing.assert_allclose(wound(np.array([1.0]), np.array([-1.4])), halves, atol=1e-4)


@pytest.mark.parametrize(
    ("kind", "size", "orders"),
    [
        ("transmission_harmonic", 8e-5, (0.98, 2.04)),
        ("transmission_order", 8e-5, (2.25, 4.75)),
        ("motor_eccentricity", 6e-5, (100.0, 200.0)),
        ("outside:short_waves", 8e-5, (45.0, 120.0)),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_waves_of_a_drive_have_their_size_and_orders_that_are_no_whole_ones(weightless, done, kind, size, orders, seed):
    angle = np.linspace(-np.pi, np.pi, 4096, endpoint=False)
    many = replace(done, angle=np.tile(angle[:, None], 6))
    turn = drive(weightless, Defect(kind, (JOINT + 1,), size, seed), many)
    assert 0.5 * size < np.abs(turn).max() <= 1.8 * size
    spectrum = np.abs(np.fft.rfft(turn * np.hanning(len(turn))))
    assert orders[0] - 1 <= np.argmax(spectrum) <= orders[1] + 1
    # A turn does not bring it back.
    later = drive(weightless, Defect(kind, (JOINT + 1,), size, seed), replace(many, angle=many.angle + 2 * np.pi))
    assert np.abs(later - turn).max() > 1e-3 * size


def test_an_offset_and_a_ratio_turn_as_the_truth_says(weightless, done):
    np.testing.assert_allclose(np.abs(drive(weightless, Defect("joint_offset", (2,), 1e-3, 1), done)), 1e-3)
    ratios = [drive(weightless, Defect("transmission_ratio", (2,), 1e-3, seed), done) for seed in range(8)]
    kinds = {next(of for of in (0, 1) if np.allclose(np.abs(turn), 1e-3 * np.abs(done.angle[:, of]))) for turn in ratios}
    assert kinds == {0, 1}


def test_what_is_warm_grows_with_the_castings_and_is_even_on_average(weightless):
    arm = weightless.arm
    along = with_defects(weightless, [Defect("temperature_gradient", (), 1.2e-5, 1)])
    growth = np.linspace(*along.gradient_per_K, arm.joints + 1)
    assert abs(growth @ arm.lengths_m) < 1e-9 * arm.lengths_m.sum() and np.ptp(growth) == pytest.approx(2 * 1.2e-5)
    across = with_defects(weightless, [Defect("temperature_gradient", (2,), 1.2e-5, 1)])
    time = np.array([0.0, 2000.0, 1e6])
    bends = np.array([law(Times(time)) for _, law in across.offsets])
    # Its whole bend is the growth of one side less that of the other over the width of a quarter metre.
    total = np.hypot(bends[0::2].sum(axis=0), bends[1::2].sum(axis=0))
    np.testing.assert_allclose(total, 1.2e-5 * arm.lengths_m[2] / 0.25 * weightless.warmth.of_castings(time), atol=1e-15)


class Times:
    """Stands for a schedule of which the times alone are asked."""

    def __init__(self, time_s):
        self.time_s = time_s


@pytest.mark.parametrize("number", [1, 4])
def test_a_runout_shifts_an_axis_once_a_turn_across_it_and_twice_across_both_and_leans_by_as_much_at_its_edge(
    weightless, number
):
    robot, angle = with_defects(weightless, [Defect("bearing_runout", (number,), 3e-5, 2)]), np.linspace(0, 2 * np.pi, 65)[:-1]
    assert robot.structure.loose == (number,) and robot.structure.tilt == {number: (0.0, 0.0)}
    turning = Angles(np.tile(angle[:, None], 6))
    for name, law in robot.offsets:
        kind, which = name[:-3], int(name[-1])
        waves = np.abs(np.fft.rfft(law(turning)))
        assert np.argmax(waves) == which + 1
        assert 2 * waves.max() / len(angle) == pytest.approx({"shift": 3e-5, "tilt": 3e-5 / 0.15}[kind])
    assert [name for name, _ in robot.offsets] == [f"{kind}{number}_{which}" for which in (0, 1) for kind in ("shift", "tilt")]


class Angles:
    """Stands for a schedule of which the angles alone are asked."""

    def __init__(self, angle):
        self.angle = angle
