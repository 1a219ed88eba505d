"""Laws that are checked: one that holds is not doubted, one whose size goes with something else or has a wrong sign is."""

from dataclasses import replace

import numpy as np
import pytest
from planted import planted, two_loads_a_pose
from scipy.stats import binom
from synthetic import NOISE, circumstances_on, made_states, seen_exactly, with_noise

from elastocal.fitting import fit
from elastocal.law_check import LEVEL, circumstances_of_a_law, doubts

SEEDS = 12


def states(seed):
    """Temperatures come and go, so that they do not stand for the time."""
    drawn = two_loads_a_pose(6, 25, (8, seed))
    return replace(drawn, temperature_c=np.random.default_rng((9, seed)).uniform(20, 30, 50))


def varying(candidate, share):
    """The candidate with a size that is different in each state."""

    def displacement(circumstances, *shapes):
        laws = candidate.displacement(circumstances, *shapes)
        return [{coordinate: share * made for coordinate, made in law.items()} for law in laws]

    return replace(candidate, displacement=displacement)


def doubted(robot, shares, seed, parameters=slice(None)):
    """Doubts about effects whose size in each state is `shares` of their plausible one, fitted as if it were one in all."""
    around = states(seed)
    campaign = planted(robot, {}, seed, states=around)
    model, start = campaign.declared.model, campaign.declared.estimate
    members = [campaign.candidates[key] for key in shares]
    true = start.with_effects(members)
    for number, member in enumerate(members, 1):
        true.coefficients[number][parameters] = [parameter.plausible for parameter in member.parameters[parameters]]
    bent = [
        varying(member, np.broadcast_to(share, len(around))) for member, share in zip(members, shares.values(), strict=True)
    ]
    seen = with_noise(seen_exactly(model.with_effects(bent), true, around), np.random.default_rng((10, seed)))
    final = fit(model.with_effects(members), seen, replace(NOISE, joint_rad=np.zeros(6)), start.with_effects(members))
    return doubts(final, members, seen)


def grown(seed, circumstance, by):
    """Half the plausible size, and more or less with a circumstance."""
    around = states(seed)
    values = np.linalg.norm(around.wrench[:, :3], axis=1) if circumstance == "the load" else around.time_s
    return 0.5 + by * (values - values.mean()) / values.std()


EFFECTS = ("joint_offset@3", "link_weight@2", "hysteresis@2", "joint_tilt@2", "lost_motion@2", "cross_compliance@2+3")


def test_an_effect_that_follows_its_law_is_not_doubted_more_often_than_the_level_says(fanuc):
    alarms = {key: sum(bool(doubted(fanuc, {key: 0.5}, seed)) for seed in range(SEEDS)) for key in EFFECTS}
    assert sum(alarms.values()) <= binom.ppf(0.99, SEEDS * len(EFFECTS), LEVEL), alarms
    # Nor does any one of them bring it about.
    assert max(alarms.values()) <= binom.ppf(0.999, SEEDS, LEVEL), alarms


@pytest.mark.parametrize("circumstance", ["the load", "the time"])
@pytest.mark.parametrize("key", ["joint_offset@3", "link_weight@2", "hysteresis@2", "joint_tilt@2", "cross_compliance@2+3"])
def test_an_effect_that_grows_with_something_else_is_doubted_and_said_with_what(key, circumstance, fanuc):
    for seed in range(3):
        (doubt,) = doubted(fanuc, {key: grown(seed, circumstance, 0.2)}, seed)
        assert (doubt.effect, doubt.departure) == (key, f"its size goes with {circumstance}")
        assert 0 <= doubt.p_value < LEVEL


@pytest.mark.parametrize("parameters", [slice(0, 1), slice(1, 2)])
def test_all_parameters_of_a_law_are_checked_together(parameters, fanuc):
    key = "compensator_torque@2[first order]"
    (doubt,) = doubted(fanuc, {key: grown(1, "the load", 0.2)}, 1, parameters)
    assert (doubt.effect, doubt.departure) == (key, "its size goes with the load")


def test_several_effects_are_not_checked_and_joints_of_one_effect_each(fanuc):
    bent = grown(0, "the load", 0.2)
    assert doubted(fanuc, {"joint_offset@3": bent, "hysteresis@2": 0.5}, 0) == []
    both = doubted(fanuc, {"joint_offset@2": bent, "joint_offset@3": bent}, 0)
    assert {doubt.effect: doubt.departure for doubt in both} == dict.fromkeys(
        ("joint_offset@2", "joint_offset@3"), "its size goes with the load"
    )


def test_an_effect_that_grows_faster_than_its_law_is_doubted_by_its_own_size(fanuc):
    """As friction that is overcome or a stop that is reached would have it."""
    load = np.abs(circumstances_on(fanuc.chain, states(2)).load[:, 1])
    (doubt,) = doubted(fanuc, {"cross_compliance@2+3": 2.0 * load / load.max()}, 2)
    assert (doubt.effect, doubt.departure) == ("cross_compliance@2+3", "it does not grow as its law does")


@pytest.mark.parametrize(
    ("key", "size", "doubtful"), [("joint_tilt@2", -0.5, True), ("joint_tilt@2", 0.5, False), ("joint_offset@3", -0.5, False)]
)
def test_an_effect_of_a_sign_that_its_law_does_not_have_is_doubted(key, size, doubtful, fanuc):
    found = doubted(fanuc, {key: size}, 4)
    assert bool(found) == doubtful
    assert all(
        doubt.effect == key and doubt.departure.endswith("should be positive") and doubt.p_value < 1e-6 for doubt in found
    )


def test_circumstances_have_mean_zero_and_mean_square_one(fanuc):
    drawn = states(0)
    found = circumstances_of_a_law(circumstances_on(fanuc.chain, drawn), (2, 5))
    assert set(found) == {
        *("the load", "the time", "the temperature"),
        *(f"the angle of joint {joint}" for joint in range(1, 7)),
        *(f"the side from which the load turns joint {joint}" for joint in (2, 5)),
        *(f"the side from which joint {joint} comes" for joint in (2, 5)),
    }
    for name, values in found.items():
        assert values.shape == (50, 2 if "angle" in name else 1)
        np.testing.assert_allclose(values.mean(axis=0), 0.0, atol=1e-12)
        np.testing.assert_allclose((values**2).mean(axis=0), 1.0, atol=1e-12)
    expected = {
        "the load": np.linalg.norm(drawn.wrench[:, :3], axis=1),
        "the time": drawn.time_s,
        "the temperature": drawn.temperature_c,
        "the angle of joint 2": np.cos(drawn.joint_angles[:, 1]),
        "the side from which joint 5 comes": drawn.approach[:, 4],
    }
    for name, values in expected.items():
        assert np.corrcoef(found[name][:, 0], values)[0, 1] == pytest.approx(1.0), name
    assert np.corrcoef(found["the angle of joint 5"][:, 1], np.sin(drawn.joint_angles[:, 4]))[0, 1] == pytest.approx(1.0)


def test_circumstances_that_do_not_vary_or_are_not_known_are_left_out(fanuc):
    still = made_states(6, 30, seed=1)
    still.joint_angles[:, 1] = 0.3
    still.approach[:, 1] = 1.0
    still.temperature_c[:] = 21.0
    # The weight of one load, which turns joint 2 one way.
    still.wrench[:] = [0.0, 0.0, -500.0, 0.0, 0.0, 0.0]
    around = circumstances_on(fanuc.chain, still)
    assert set(np.sign(around.load[:, 1])) == {1.0}
    angles = {f"the angle of joint {joint}" for joint in (1, 3, 4, 5, 6)}
    assert set(circumstances_of_a_law(around, (2,))) == {"the time"} | angles
    still.wrench[:] = 0.0
    around = circumstances_on(fanuc.chain, still)
    assert set(circumstances_of_a_law(around, (2,))) == {"the time"} | angles
    unknown = circumstances_on(fanuc.chain, replace(still, approach=None, time_s=None, temperature_c=None))
    assert set(circumstances_of_a_law(unknown, (2,))) == angles
