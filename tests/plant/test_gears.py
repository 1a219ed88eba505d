"""Each law of a gear, as a machine has it and not as the catalogue writes it."""

import numpy as np
import pytest

from elastocal_proof.plant.gears import (
    AngleDependentStiffness,
    Asymmetric,
    BoucWen,
    CableTransmission,
    CompensatorStiffness,
    Coupling,
    DeadBand,
    GearStates,
    LinearSprings,
    StepwiseStiffening,
    WarmSoftening,
)


def states(torque, angle=0.0, approach=1, unloaded=0.0, temperature=20.0, previous=-1, joint=1):
    """States of a robot of three joints, of which one carries a torque."""
    torque = np.atleast_1d(np.asarray(torque, float))

    def spread(value):
        full = np.zeros((len(torque), 3))
        full[:, joint] = value
        return full

    one = np.ones(len(torque))
    return GearStates(
        spread(torque), spread(unloaded), spread(angle), spread(approach), temperature * one, previous * one.astype(int)
    )


def turn(law, *arguments, **more):
    """Of the joint with the torque; the others stand still."""
    found = law(states(*arguments, **more))
    assert not np.delete(found, 1, axis=1).any()
    return found[:, 1]


def test_linear_springs_turn_by_compliance_times_torque():
    np.testing.assert_allclose(turn(LinearSprings(np.array([1e-6, 2e-6, 3e-6])), [100.0, -50.0]), [2e-4, -1e-4])


def test_a_closed_gap_adds_half_the_play_whatever_the_torque_and_an_open_one_nothing_abrupt():
    law = DeadBand(1, 1e-4, 20.0)
    np.testing.assert_allclose(turn(law, [20.0, 500.0, -500.0, 0.0, 10.0]), [1e-4, 1e-4, -1e-4, 0.0, 5e-5])


def test_stiffening_is_none_below_the_first_step_odd_and_linear_in_pieces():
    law = StepwiseStiffening(1, ((100.0, 1e-7), (300.0, 2e-7)))
    np.testing.assert_allclose(turn(law, [99.0, 200.0, -200.0, 400.0]), [0.0, -1e-5, 1e-5, -3e-5 - 2e-5])


def test_stiffness_follows_the_angle_of_its_own_or_another_joint():
    law = AngleDependentStiffness(1, 1e-6, 0.2, 0.5, 1)
    np.testing.assert_allclose(
        turn(law, [100.0, 100.0], angle=[0.5, 0.5 + np.pi]), [1e-4 * (1 / 1.2 - 1), 1e-4 * (1 / 0.8 - 1)]
    )
    foreign = AngleDependentStiffness(1, 1e-6, 0.2, 0.0, 2)
    # The other joint stands at zero, wherever this one is.
    np.testing.assert_allclose(turn(foreign, [100.0, 100.0], angle=[0.0, 2.0]), 1e-4 * (1 / 1.2 - 1))


def test_a_compensators_stiffness_is_the_second_derivative_of_its_energy():
    law = CompensatorStiffness(1, 3e-7, 1e6, 0.4, 0.2, 0.25, 0.3)
    angle, step = np.linspace(-1.5, 1.5, 7), 1e-4

    def energy(q):
        length = np.sqrt(0.4**2 + 0.2**2 - 2 * 0.4 * 0.2 * np.cos(q - 0.3))
        return 0.5 * 1e6 * (length - 0.25) ** 2

    stiffness = (energy(angle + step) - 2 * energy(angle) + energy(angle - step)) / step**2
    wanted = 1000.0 * (1.0 / (1.0 / 3e-7 + stiffness) - 3e-7)
    np.testing.assert_allclose(turn(law, np.full(7, 1000.0), angle=angle), wanted, rtol=1e-4)


def test_coupled_gears_turn_each_other_alike():
    found = Coupling((1, 2), 1e-7)(states([100.0, 100.0]))
    np.testing.assert_allclose(found, [[0.0, 0.0, 1e-5]] * 2)


def test_at_rest_an_arm_stays_half_the_width_behind_its_approach():
    law = BoucWen(1, 5e-5, 300.0)
    np.testing.assert_allclose(turn(law, [0.0, 0.0], approach=[1, -1]), [-5e-5, 5e-5])


def test_a_load_against_the_approach_turns_the_friction_round_and_one_along_it_does_not():
    law = BoucWen(1, 5e-5, 300.0)
    along, against = turn(law, [3000.0, -3000.0])
    assert along == pytest.approx(-5e-5)
    assert against == pytest.approx(5e-5, rel=1e-3)


def test_hysteresis_goes_round_a_closed_loop_that_takes_energy():
    """After a whole cycle between equal loads it is where it was; on the way down it is further out than on the way up."""
    law = BoucWen(1, 1.0, 300.0)
    z, path = np.array([0.0]), []
    for change in (500.0, *(-1000.0, 1000.0) * 3):
        z = law.moved(z, np.array([change]))
        path.append(float(z[0]))
    assert path[2] == pytest.approx(path[4], abs=1e-3)
    up, down = (-law.moved(np.array([path[end]]), np.array([change])) for end, change in ((1, 500.0), (2, -500.0)))
    assert down - up > 0.3


def test_hysteresis_depends_on_the_order_of_loads_and_not_on_how_finely_they_are_split():
    law = BoucWen(1, 1.0, 300.0)
    whole = law.moved(np.array([1.0]), np.array([-400.0]))
    halves = law.moved(law.moved(np.array([1.0]), np.array([-200.0])), np.array([-200.0]))
    np.testing.assert_allclose(whole, halves, atol=1e-4)


def test_a_ladder_without_a_move_carries_its_history_along():
    law = BoucWen(1, 1.0, 300.0)
    given = states([0.0, -800.0, -400.0])
    chained = GearStates(
        given.torque, given.unloaded, given.angle, given.approach, given.temperature_c, np.array([-1, 0, 1], dtype=int)
    )
    # Half the load, reached from none and from the whole.
    assert law(given)[2, 1] - law(chained)[2, 1] > 0.3
    np.testing.assert_allclose(law(given)[:2], law(chained)[:2])


def test_what_weight_has_wound_up_before_the_load_is_no_part_of_the_history():
    law = BoucWen(1, 1.0, 300.0)
    assert turn(law, [-900.0], unloaded=-900.0) == pytest.approx(-1.0)


def test_an_asymmetric_gear_turns_alike_for_both_signs():
    np.testing.assert_allclose(turn(Asymmetric(1, 1e-10), [1000.0, -1000.0]), [1e-4, 1e-4])


def test_a_gear_softens_with_the_temperature_over_twenty_degrees():
    law = WarmSoftening(1, 1e-6, 0.01)
    np.testing.assert_allclose(turn(law, [100.0], temperature=30.0), 1e-5)
    np.testing.assert_allclose(turn(law, [100.0], temperature=20.0), 0.0)


def test_a_cable_yields_as_its_free_length_and_to_the_tension_of_the_joint_whose_pulley_it_passes():
    law = CableTransmission(1, 1e-6, 0.5, 2)
    np.testing.assert_allclose(turn(law, [100.0, -100.0], angle=[np.pi / 2, 0.0]), [1.25e-4, -1e-4])
    behind = states([100.0], joint=2)
    np.testing.assert_allclose(law(behind)[0], [0.0, 5e-5, 0.0])
