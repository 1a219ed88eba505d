"""Errors of angle that no load is needed for."""

import numpy as np
import pytest

from elastocal_proof.plant.drives import (
    CablePull,
    PoseError,
    Repeatability,
    Runout,
    SlippingZero,
    TransmissionError,
    Visits,
    WrongRatio,
    ZeroOffset,
)


@pytest.fixture
def visits(rng):
    """Two states an approach."""
    approach = np.repeat(np.arange(100), 2)
    return Visits(rng.uniform(-3, 3, (100, 4))[approach], approach, approach, 25.0 * np.arange(200), 5)


def test_an_offset_and_a_ratio_turn_their_joint_alone(visits):
    found = ZeroOffset(2, 1e-3)(visits)
    assert (found[:, 2] == 1e-3).all()
    assert not np.delete(found, 2, axis=1).any()
    np.testing.assert_allclose(WrongRatio(3, 1, 2e-4)(visits)[:, 3], 2e-4 * visits.angle[:, 1])
    np.testing.assert_allclose(CablePull(3, (2, 3), 2e-4)(visits)[:, 3], 2e-4 * visits.angle[:, 2] * visits.angle[:, 3])


def test_a_transmission_error_may_have_any_order(visits):
    found = TransmissionError(1, ((17.3, 1e-4, 0.4), (2.0, 5e-5, 0.0)))(visits)[:, 1]
    q = visits.angle[:, 1]
    np.testing.assert_allclose(found, 1e-4 * np.sin(17.3 * q + 0.4) + 5e-5 * np.sin(2 * q))
    # Of an order that is no integer, a turn does not bring it back.
    turned = Visits(visits.angle + 2 * np.pi, visits.approach, visits.pose, visits.time_s, 5)
    assert np.abs(TransmissionError(1, ((17.3, 1e-4, 0.4),))(turned)[:, 1] - 1e-4 * np.sin(17.3 * q + 0.4)).max() > 1e-5


def test_repeatability_is_drawn_afresh_for_each_approach_and_shared_by_its_loads(visits):
    found = Repeatability((2e-5, 1e-5, 0.0, 3e-5))(visits)
    np.testing.assert_array_equal(found[0::2], found[1::2])
    np.testing.assert_allclose(found[::2].std(axis=0), [2e-5, 1e-5, 0.0, 3e-5], rtol=0.25)
    assert np.abs(np.diff(found[::2, 0])).min() > 0


def test_a_slipping_zero_walks_at_some_moves_and_stands_between_them(visits):
    found = SlippingZero(0, 1e-4, 0.3)(visits)[:, 0]
    np.testing.assert_array_equal(found[0::2], found[1::2])
    slips = np.diff(found[::2])
    assert 0.15 < (slips != 0).mean() < 0.45
    assert np.std(slips[slips != 0]) == pytest.approx(1e-4, rel=0.4)


def test_the_same_seed_gives_the_same_draws_and_another_seed_others(visits):
    law = Repeatability((1e-5,) * 4)
    np.testing.assert_array_equal(law(visits), law(visits))
    other = Visits(visits.angle, visits.approach, visits.pose, visits.time_s, 6)
    assert (law(visits) != law(other)).all()


def test_an_error_of_the_pose_is_the_same_in_all_its_measurements(visits):
    poses = np.arange(200) // 8
    turn = PoseError((1e-5, 0.0, 1e-5, 1e-5))(Visits(visits.angle, visits.approach, poses, visits.time_s, 5))
    assert not turn[:, 1].any()
    for pose in range(25):
        assert np.ptp(turn[poses == pose], axis=0).max() == 0.0
    assert np.unique(turn[:, 0]).size == 25
    # 25 draws: their standard deviation is known to 14 %.
    assert turn[::8, 0].std() == pytest.approx(1e-5, rel=0.4)


@pytest.mark.parametrize("order", [1, 2])
def test_a_runout_comes_back_after_each_period_and_is_opposite_after_half_of_one(visits, order):
    law = Runout(2, order, 1e-5, 0.3)
    for periods, sign in ((0.5, -1), (1.0, 1)):
        later = Visits(visits.angle + periods * 2 * np.pi / order, visits.approach, visits.pose, visits.time_s, 5)
        np.testing.assert_allclose(law(later), sign * law(visits), atol=1e-18)
    assert 0.9e-5 < np.abs(law(visits)).max() <= 1e-5
