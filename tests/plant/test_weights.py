"""What links weigh: as declared, by rule, as drawn, and the torques that follow."""

import numpy as np
import pytest
from analysed_robots import ROBOTS
from arms_at_rest import arm_of

from elastocal_proof.plant.arm import LinkMass, arm_from_file
from elastocal_proof.plant.machine import Mass
from elastocal_proof.plant.weights import (
    allowed_centre_std_m,
    centre_std_m,
    declared_masses,
    off_the_line,
    true_masses,
    usual_gravity_torque,
)

CHAIN = "Tz(0.4) Ry(q1) Tx(2) Ry(q2) [elbow] Tx(1) [hand]"
TWO = arm_of(CHAIN)


def test_where_the_file_has_none_each_link_behind_the_carousel_weighs_half_of_the_one_before():
    guessed = declared_masses(arm_from_file(ROBOTS / "kuka.yaml"))
    mass, total = np.array([m.mass_kg for m in guessed]), sum(m.mass_kg for m in guessed)
    assert [m.link for m in guessed] == list(range(7)) and {m.relative_std for m in guessed} == {0.1}
    np.testing.assert_allclose(mass[3:] / mass[2:-1], 0.5, rtol=5e-3)
    np.testing.assert_allclose(mass[:2] / total, [0.18, 0.27], rtol=1e-3)


@pytest.mark.parametrize(
    "centre, std, allowed", [((0.0, 0.3, 0.4), 0.01, 0.01), ((0.0, 0.0, 0.0), 0.002, 0.006), ((0.2, 0.0, 0.0), 0.004, 0.006)]
)
def test_a_centre_is_known_as_a_share_of_its_distance_and_no_better_than_a_short_lever(centre, std, allowed):
    mass = LinkMass(1, 10.0, centre, 0.02)
    assert centre_std_m(mass) == pytest.approx(std)
    assert allowed_centre_std_m(mass, 3.0) == pytest.approx(allowed)


def test_masses_of_specimens_scatter_about_the_declared_ones_as_these_are_known():
    declared = (LinkMass(1, 50.0, (0.3, 0.0, 0.4), 0.1),) * 2000
    drawn = true_masses(declared, np.random.default_rng(2))
    off = np.column_stack([[m.mass_kg / 50.0 - 1.0 for m in drawn], np.array([m.centre_m for m in drawn]) - (0.3, 0.0, 0.4)])
    off /= [0.1, 0.05, 0.05, 0.05]
    # Four standard errors of 2000 normal draws: a right generator fails four means and four deviations once in 2,000 seeds.
    np.testing.assert_allclose(off.mean(axis=0), 0.0, atol=4 / np.sqrt(2000))
    np.testing.assert_allclose(off.std(axis=0), 1.0, atol=4 / np.sqrt(4000))
    assert np.abs(off).max() <= 3.0 + 1e-9
    assert np.abs(np.corrcoef(off.T) - np.eye(4)).max() < 4 / np.sqrt(2000)


def test_centres_off_the_line_move_across_it_alone_and_weights_stay():
    arm, largest = TWO, 0.02
    masses = (LinkMass(0, 9.0, (0.0, 0.0, 0.1), 0.1), LinkMass(1, 8.0, (0.5, 0.0, 0.0), 0.1)) * 100
    moved = off_the_line(masses, arm, largest, np.random.default_rng(4))
    shift = np.array([m.centre_m for m in moved]) - np.array([m.centre_m for m in masses])
    assert [(m.link, m.mass_kg) for m in moved] == [(m.link, m.mass_kg) for m in masses]
    for link, along, across in ((0, [2], [0, 1]), (1, [0], [1, 2])):
        mine = shift[link::2]
        np.testing.assert_allclose(mine[:, along], 0.0, atol=1e-15)
        assert (np.abs(mine[:, across]) <= largest).all() and (np.abs(mine[:, across]).max(axis=0) > 0.8 * largest).all()


def test_usual_torque_of_weight_is_the_root_mean_square_of_mass_gravity_and_horizontal_lever():
    arm, masses = TWO, (Mass(0, 99.0, 0.5), Mass(1, 10.0, 0.5), Mass(2, 4.0, 1.0))
    found = usual_gravity_torque(arm, masses, (0.0, 0.0, -9.8))
    # Both angles are evenly spread over a whole turn, of which 64 draws are known to a tenth.
    fore = 9.8 * 4.0 * np.sqrt(0.5)
    upper = 9.8 * (10.0 + 4.0 * 2.0) * np.sqrt(0.5)
    np.testing.assert_allclose(found, [np.hypot(upper, fore), fore], rtol=0.15)
