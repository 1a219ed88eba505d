"""Effects periodic in the angle of a joint: by chains that have the moved axis as transforms of their own."""

from dataclasses import replace

import numpy as np
import pytest
from support import OTHER_CHAINS, chain_of
from synthetic import (
    NOISE,
    candidate_on,
    conditions_on,
    displacements,
    equipped,
    made_estimate,
    made_model,
    made_states,
    seen_exactly,
    with_noise,
)

from elastocal.campaigns.campaign import Target
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.displacement import conditions, displaced_coordinates
from elastocal.fitting.least_squares import fit
from elastocal.fitting.observations import Observations
from elastocal.fitting.prediction import predict
from elastocal.mechanics.chain import Chain, MeasuringPoint, Transform
from elastocal.mechanics.kinematics import poses

CHAINS = ["fanuc", "ur10", "fixed rotations", "seven joints"]


def chain_called(name, fanuc):
    return fanuc.chain if name == "fanuc" else chain_of(OTHER_CHAINS[name])


def predicted(chain, candidate, values, states):
    """Pose of the end of a chain without springs, with one effect at some size."""
    model = made_model(chain, (Target("A", chain.end_effector.name, (0, 0, 0)),), 6, False, np.zeros(chain.coordinates))
    model = model.with_effects((candidate,))
    estimate = replace(made_estimate(model), coefficients=(np.array(values, float),))
    count = len(states)
    seen = Observations(states, np.arange(count), np.zeros(count, int), np.zeros((count, 3)), None)
    return predict(model, estimate, seen, conditions(model, estimate, states))


def with_moved_axis(chain, joint, kind):
    """The chain with three coordinates of its own directly before a joint: shifts or turns along the axes fixed there."""
    place = next(index for index, t in enumerate(chain.transforms) if t.coordinate == joint)
    moving = [Transform(kind, axis, 0.0, chain.coordinates + axis) for axis in range(3)]
    transforms = (*chain.transforms[:place], *moving, *chain.transforms[place:])
    return Chain(transforms, (MeasuringPoint("end", len(transforms)),), chain.coordinates + 3)


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("way", ["radial", "axial", "wobble"])
def test_bearing_that_runs_out_moves_its_axis_along_axes_fixed_before_the_joint(name, way, fanuc):
    chain = chain_called(name, fanuc)
    states = made_states(chain.coordinates, 6, seed=1, span=3.0)
    for joint in range(chain.coordinates):
        candidate = candidate_on(chain, f"bearing_runout@{joint + 1}[{way}]")
        values = 1e-6 * np.random.default_rng(joint).standard_normal(len(candidate.parameters))
        other = with_moved_axis(chain, joint, "R" if way == "wobble" else "T")
        coordinates = np.zeros((6, other.coordinates))
        coordinates[:, : chain.coordinates] = states.joint_angles
        angle = states.joint_angles[:, joint]
        for value, parameter in zip(values, candidate.parameters, strict=True):
            _, axis, wave, order = parameter.name.split("_")
            factor = int(order.removesuffix("q"))
            coordinates[:, chain.coordinates + "xyz".index(axis)] += value * getattr(np, wave)(factor * angle)
        found, expected = predicted(chain, candidate, values, states), poses(other, coordinates, other.end_effector)
        # Turns by microradians do not add up to more than their products.
        np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=1e-10)
        np.testing.assert_allclose(found[1], expected[1], rtol=0, atol=1e-10)
        still = poses(chain, states.joint_angles, chain.end_effector)[0]
        turns = way == "wobble"
        assert turns or np.abs(expected[0] - still).max() > 5e-7


def test_axial_runout_is_along_the_axis_and_the_others_across(fanuc):
    for joint, t in enumerate(t for t in fanuc.chain.transforms if t.coordinate is not None):
        for way in ("radial", "axial", "wobble"):
            named = {p.name.split("_")[1] for p in candidate_on(fanuc.chain, f"bearing_runout@{joint + 1}[{way}]").parameters}
            own = "xyz"[t.axis]
            assert named == ({own} if way == "axial" else {*"xyz"} - {own})


def test_motor_turns_the_joint_once_and_twice_per_turn_of_its_own(fanuc):
    sites = replace(equipped(fanuc), gear_ratio=(None, 171.0, None, None, 80.5, None))
    known = candidates_on(sites)
    assert [key for key in known if key.startswith("motor_eccentricity")] == ["motor_eccentricity@2", "motor_eccentricity@5"]
    states = made_states(6, 5, seed=2)
    around = replace(conditions_on(fanuc, states), sites=sites)
    made = displacements(known["motor_eccentricity@5"], around)
    turn = 80.5 * states.joint_angles[:, 4]
    np.testing.assert_allclose(made[:, :, 4], [np.cos(turn), np.sin(turn), np.cos(2 * turn), np.sin(2 * turn)], atol=1e-12)
    assert not np.delete(made, 4, axis=2).any()


def test_motor_without_a_known_ratio_has_no_candidate(fanuc):
    assert not any(key.startswith("motor_eccentricity") for key in candidates_on(replace(equipped(fanuc), gear_ratio=None)))


def test_order_may_lie_anywhere_between_two_integers_and_away_from_both(fanuc):
    known, states = candidates_on(equipped(fanuc)), made_states(6, 5, seed=3)
    bands = [c for c in known.values() if c.effect == "transmission_order" and c.joints == (3,)]
    for above, band in enumerate(bands, 1):
        (shape,) = band.shapes
        assert above < shape.lowest < shape.start == above + 0.5 < shape.highest < above + 1
        np.testing.assert_array_equal(shape.values(3), [above + 0.5])
        assert band.distinct_angles == 4 * (above + 1)
    assert len(bands) == 17 and len({band.location for band in bands}) == 17
    around = conditions_on(fanuc, states)
    made = displacements(bands[1], around, 2.7)
    angle = states.joint_angles[:, 2]
    np.testing.assert_allclose(made[:, :, 2], [np.cos(2.7 * angle), np.sin(2.7 * angle)], rtol=1e-13)


def test_order_between_integers_is_fitted_where_it_is(fanuc):
    candidate = candidate_on(fanuc, "transmission_order@3[order 2-3]")
    model = made_model(fanuc, (Target("A", "6DoF", (0.1, 0, 0)),), fitted_frames=False, effects=(candidate,))
    true = replace(made_estimate(model), coefficients=(np.array([2e-4, -3e-4]),), shapes=(np.array([2.68]),))
    seen = with_noise(seen_exactly(model, true, made_states(6, 60, seed=5, span=2.5)), np.random.default_rng(6))
    found = fit(model, seen, NOISE, made_estimate(model, size=0.0))
    assert found.converged
    assert abs(found.estimate.shapes[0][0] - 2.68) < 4 * np.sqrt(found.covariance[-1, -1]) < 0.3


def test_shape_without_values_of_its_own_is_tried_in_a_geometric_series(fanuc):
    (shape,) = candidate_on(fanuc, "lost_motion@2").shapes
    values = shape.values(3)
    assert len(values) == 3 and shape.lowest < values[0] and values[-1] < shape.highest
    np.testing.assert_allclose(np.diff(np.log(values)), np.log(shape.highest / shape.lowest) / 4)


def test_runout_of_a_joint_leaves_the_arm_before_it_alone(fanuc):
    candidate = candidate_on(fanuc.chain, "bearing_runout@3[radial]")
    model = made_model(fanuc.chain, effects=(candidate,), compliance=np.zeros(6))
    estimate, states = made_estimate(model, size=1.0), made_states(6, 4, seed=4)
    coordinates = displaced_coordinates(model, estimate, conditions(model, estimate, states))
    elbow = model.sites.chain.point("2DoF")
    still = poses(fanuc.chain, states.joint_angles, fanuc.chain.point("2DoF"))[0]
    np.testing.assert_array_equal(poses(model.sites.chain, coordinates, elbow)[0], still)
