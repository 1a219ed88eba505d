"""The next experiment: what it promises is what least squares gives, and an exact alias is told apart where it can be."""

from dataclasses import replace

import numpy as np
import pytest
from planted import HAND, planted
from support import robot_of
from synthetic import made_states

from elastocal.attribution import Attribution
from elastocal.campaign import Target
from elastocal.elastostatics import wrench_of_offset_force
from elastocal.fitting import fit
from elastocal.model import circumstances, effect_columns, linearize
from elastocal.next_experiment import propose
from elastocal.observations import Observations, States
from elastocal.whitening import whitening


def found_in(campaign, key):
    """The fit with one effect, which is taken as found."""
    candidate = campaign.candidates[key]
    start = campaign.declared.estimate.with_effects([candidate])
    return fit(campaign.declared.model.with_effects([candidate]), campaign.observations, campaign.declared.noise, start)


def against(campaign, found, *rivals):
    """An attribution of what was found that these rivals could stand for."""
    count = len(rivals)
    members = (campaign.candidates[found],)
    return Attribution(members[0].effect, members, 0.01, rivals, np.zeros(count), np.zeros(count), np.ones(count, int), 1)


def proposed(campaign, found, rivals, limits, count=3, seed=0, ladder=None):
    final = found_in(campaign, found)
    attribution = against(campaign, found, *rivals)
    draws = np.random.default_rng(seed)
    return final, propose(final, attribution, campaign.observations, campaign.candidates, limits, count, draws, ladder)


def rows_of(final, found, rival, targets, observations):
    """Whitened: everything fitted but what was found, the rival, and what was found at its fitted size."""
    number = [effect.key for effect in final.model.effects].index(found.key)
    model = replace(final.model, targets=targets)
    turns = np.tile(np.eye(3), (len(targets), 1, 1))
    estimate = replace(final.estimate, target_offset=np.array([t.offset_m for t in targets]), target_rotation=turns)
    around = circumstances(model, estimate, observations.states)
    line = linearize(model, estimate, observations, around)
    mine = np.array([owner == found.key for owner, _ in final.parameters])
    size = np.array([parameter.plausible for _, parameter in final.parameters])
    others = (line.sensitivities * size)[..., ~mine & ~final.held]
    other = effect_columns([(rival, [s.start for s in rival.shapes])], around, line.coordinate_jacobian, observations.state)
    other = other * [parameter.plausible for parameter in rival.parameters]
    values = final.estimate.coefficients[number], final.estimate.shapes[number]
    made = effect_columns([(found, values[1])], around, line.coordinate_jacobian, observations.state) @ values[0]
    whitener = whitening(observations, line.coordinate_jacobian[..., : model.sites.joints], final.noise, final.discrepancy_m)
    stacked = whitener.apply(np.concatenate([others, other, made[..., None]], axis=-1))
    return stacked.reshape(-1, stacked.shape[-1])


def left_over(rows):
    """Squared length of the last column that no combination of the others makes."""
    others, last = rows[:, :-1], rows[:, -1]
    return ((last - others @ np.linalg.lstsq(others, last, rcond=1e-10)[0]) ** 2).sum()


def states_of(proposal, observations, shares=(1.0,)):
    poses, joints = proposal.joint_angles.shape
    count, shares = poses * len(shares), np.array(shares)
    return States(
        np.zeros(count, int),
        np.arange(count),
        np.ones(count, int),
        np.repeat(proposal.joint_angles, len(shares), axis=0),
        (proposal.wrench[:, None] * shares[:, None]).reshape(count, -1),
        np.ones(count, int),
        np.zeros((count, joints)),
        np.full(count, observations.states.time_s.max()),
        np.full(count, observations.states.temperature_c.mean()),
    )


def separations_by_least_squares(campaign, final, found, rivals, proposal, shares=(1.0,)):
    """With the campaign alone, and after each proposed state."""
    found, rivals = campaign.candidates[found], [campaign.candidates[key] for key in rivals]
    chain = final.model.sites.chain
    targets = list(final.model.targets)
    taken = {target.point for target in targets}
    targets += [Target(point.name, point.name, (0.0, 0.0, 0.0)) for point in chain.points if point.name not in taken]
    points = [point.split() for point in proposal.point for _ in shares]
    target = np.array([[t.point for t in targets].index(point) for read in points for point in read])
    rotation = np.tile(np.eye(3), (len(target), 1, 1)) if final.model.rows == 6 else None
    states = states_of(proposal, campaign.observations, shares)
    state = np.repeat(np.arange(len(points)), len(points[0]))
    beyond = Observations(states, state, target, np.zeros((len(target), 3)), rotation)
    worst = []
    for rival in rivals:
        here = rows_of(final, found, rival, final.model.targets, campaign.observations)
        there = rows_of(final, found, rival, tuple(targets), beyond).reshape(len(proposal.point), -1, here.shape[1])
        worst.append([left_over(np.concatenate([here, *there[:count]])) for count in range(len(there) + 1)])
    return np.min(worst, axis=0)


CONTESTS = {
    "bearing against link": ("link_elasticity@2", ["joint_tilt@2"]),
    "several rivals": ("link_elasticity@2", ["joint_tilt@2", "joint_tilt@1", "base_compliance"]),
    "a rival with a shape": ("stiffening@2", ["lost_motion@2"]),
    "a law with a shape": ("lost_motion@2", ["stiffening@2"]),
    # Four parameters: what the present poses do not say of them is unknown, and not known to be nothing.
    "orders of which three poses tell three": ("joint_offset@3", ["transmission_harmonic@3[orders 1-2]"]),
}


@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("contest", CONTESTS)
def test_separations_are_what_least_squares_leaves(contest, rows, kuka):
    found, rivals = CONTESTS[contest]
    poses = 3 if "three" in contest else 20
    candidate = planted(kuka, {}, poses=6).candidates[found]
    size = [0.5 * parameter.plausible for parameter in candidate.parameters]
    campaign = planted(kuka, {found: size}, poses=poses, targets=HAND, rows=rows, identified=poses > 3)
    final, proposal = proposed(campaign, found, rivals, kuka.joint_limits)
    expected = separations_by_least_squares(campaign, final, found, rivals, proposal)
    # Other fits to the same data, without what was found: a little off.
    tolerance = {"rtol": 2e-3, "atol": 3e-3 * expected.max()}
    np.testing.assert_allclose([proposal.present, *proposal.separation], expected, **tolerance)


def test_poses_with_a_ladder_are_worth_what_least_squares_leaves_and_chosen_once(kuka):
    found, rivals = "link_elasticity@2", ["joint_tilt@2", "joint_tilt@1"]
    campaign = planted(kuka, {found: [1.5e-7, 1.5e-7]}, targets=(Target("elbow", "3DoF", (0.0, 0.0, 0.0)), *HAND))
    shares = (0.0, 1.0, -0.5)
    final, proposal = proposed(campaign, found, rivals, kuka.joint_limits, 12, ladder=shares)
    assert proposal.point == ("3DoF 6DoF",) * 12
    assert len(np.unique(proposal.joint_angles, axis=0)) == 12
    expected = separations_by_least_squares(campaign, final, found, rivals, proposal, shares)
    tolerance = {"rtol": 2e-3, "atol": 3e-3 * expected.max()}
    np.testing.assert_allclose([proposal.present, *proposal.separation], expected, **tolerance)


def test_a_ladder_begins_at_the_larger_loads_of_the_campaign(kuka):
    campaign = planted(kuka, {"link_elasticity@2": [1.5e-7, 1.5e-7]}, targets=HAND)
    states = campaign.observations.states
    halved = replace(states, wrench=states.wrench * np.where(states.pose % 2, 1.0, 0.5)[:, None])
    campaign = replace(campaign, observations=replace(campaign.observations, states=halved))
    _, proposal = proposed(campaign, "link_elasticity@2", ["joint_tilt@2"], kuka.joint_limits, 160, ladder=(0.0, 1.0))
    force = np.linalg.norm(halved.wrench[:, :3], axis=1)
    assert (np.linalg.norm(proposal.wrench[:, :3], axis=1) >= np.median(force)).all()


def test_states_are_within_limits_under_loads_of_the_campaign_and_raise_the_separation(kuka):
    campaign = planted(kuka, {"link_elasticity@2": [1.5e-7, 1.5e-7]}, targets=HAND)
    _, proposal = proposed(campaign, "link_elasticity@2", ["joint_tilt@2", "joint_tilt@1"], kuka.joint_limits, 5)
    low, high = kuka.joint_limits.T
    assert ((proposal.joint_angles >= low) & (proposal.joint_angles <= high)).all()
    loads = np.concatenate([campaign.observations.states.wrench, -campaign.observations.states.wrench])
    assert all((np.abs(loads - wrench).max(axis=1) == 0).any() for wrench in proposal.wrench)
    assert (np.diff([proposal.present, *proposal.separation]) > 0).all()
    assert set(proposal.point) <= {point.name for point in kuka.chain.points}
    places = np.column_stack([proposal.joint_angles, proposal.wrench])
    chosen = {(*place, point) for place, point in zip(places.tolist(), proposal.point, strict=True)}
    assert len(chosen) == 5


def test_the_same_stream_proposes_the_same(kuka):
    campaign = planted(kuka, {"link_elasticity@2": [1.5e-7, 1.5e-7]}, targets=HAND)
    one, other, another = (
        proposed(campaign, "link_elasticity@2", ["joint_tilt@2"], kuka.joint_limits, 2, seed)[1] for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.joint_angles, other.joint_angles)
    assert one.point == other.point and (one.separation == other.separation).all()
    assert (one.joint_angles != another.joint_angles).any()


# A planar arm under loads in its plane, read as poses of its hand: bending of the upper arm makes what the compliances of both
# joints and of one joint for the torque of the other make together. The elbow turns with the arm alone, not with the second
# joint.
PLANAR = "Ry(q1) Tx(1) [elbow] Ry(q2) Tx(0.8) [hand]"
LIMITS = np.array([[-1.2, 1.2], [-1.2, 1.2]])
UPPER_ARM, BOTH_JOINTS = "link_elasticity@1", "cross_compliance@1+2"


@pytest.fixture(scope="module")
def planar():
    """By what was found: campaigns that cannot tell it from the other of the two."""
    robot = robot_of(PLANAR)
    states = made_states(2, 30, seed=11)
    force = 800 * np.random.default_rng(12).standard_normal((30, 3)) * [1, 0, 1]
    states = replace(states, wrench=wrench_of_offset_force(force, (0.3, 0.0, 0.2)))
    sizes = {UPPER_ARM: [2e-6, 0.0], BOTH_JOINTS: [1e-6]}
    targets = (Target("hand", "hand", (0.0, 0.0, 0.0)),)
    return {key: planted(robot, {key: size}, targets=targets, states=states, rows=6) for key, size in sizes.items()}


@pytest.mark.parametrize(("found", "rival"), [(UPPER_ARM, BOTH_JOINTS), (BOTH_JOINTS, UPPER_ARM)])
def test_an_exact_alias_at_the_hand_is_told_at_the_elbow(found, rival, planar):
    campaign = planar[found]
    final, proposal = proposed(campaign, found, [rival], LIMITS)
    assert proposal.present == pytest.approx(0.0, abs=0.1)
    assert proposal.point[0] == "elbow"
    assert proposal.separation[-1] > 10
    expected = separations_by_least_squares(campaign, final, found, [rival], proposal)
    np.testing.assert_allclose(proposal.separation, expected[1:], rtol=0.02)


def test_more_of_the_hand_would_not_tell_an_exact_alias(planar):
    """All states of the pool at the hand together: the elbow is no matter of taste."""
    campaign = planar[UPPER_ARM]
    final = found_in(campaign, UPPER_ARM)
    seen = campaign.observations
    rng = np.random.default_rng(13)
    states = replace(seen.states, joint_angles=rng.uniform(-1.2, 1.2, (len(seen.states), 2)))
    found, rival = campaign.candidates[UPPER_ARM], campaign.candidates[BOTH_JOINTS]
    rows = [rows_of(final, found, rival, final.model.targets, replace(seen, states=s)) for s in (seen.states, states)]
    without_rival = left_over(np.concatenate([np.delete(part, -2, axis=1) for part in rows]))
    assert without_rival > 100
    # Loads at the deflected pose tell them apart, to the order of deflection over reach.
    assert left_over(np.concatenate(rows)) < 5e-3 * without_rival
