"""Held-out errors: metrics by hand, intervals against a direct computation, the noise floor against simulation."""

from dataclasses import replace

import numpy as np
import pytest
from planted import ELBOW_AND_HAND, planted
from synthetic import made_estimate, made_model, made_states, seen_exactly, with_noise

from elastocal.fitting import fit
from elastocal.held_out import METRICS, Errors, grown, intervals, noise_floor, position_errors, summary
from elastocal.model import circumstances, predict
from elastocal.noise import Noise


def test_summary_by_hand():
    found = summary(np.array([3.0, 4.0, 0.0, 5.0]))
    assert set(found) == set(METRICS)
    assert found["mean_m"] == 3.0
    assert found["rms_m"] == pytest.approx(np.sqrt(50 / 4))
    assert found["max_m"] == 5.0
    # Between the third and the fourth, at 0.95 · 3 = 2.85.
    assert found["p95_m"] == pytest.approx(4.0 + 0.85 * 1.0)


def test_summary_takes_any_leading_axes():
    many = np.random.default_rng(0).random((2, 3, 10))
    found = summary(many)
    for name in METRICS:
        assert found[name].shape == (2, 3)
        assert found[name][1, 2] == summary(many[1, 2])[name]


def test_errors_are_distances_between_measured_and_predicted_positions(fanuc):
    for rows in (3, 6):
        model = made_model(fanuc.chain, ELBOW_AND_HAND, rows, compliance=fanuc.compliance)
        estimate = made_estimate(model, seed=1)
        states = made_states(6, 8, seed=2)
        states.pose[:] = np.arange(8) // 2
        seen = seen_exactly(model, estimate, states)
        moved = with_noise(seen, np.random.default_rng(3), 1e-3, 1e-3)
        found = position_errors(model, estimate, moved)
        # A rotation of the frame changes no distance.
        np.testing.assert_allclose(found.distance, np.linalg.norm(moved.position - seen.position, axis=1), rtol=1e-9)
        assert found.cluster.tolist() == np.repeat(np.arange(4), 4).tolist()
        assert found.poses == 4
        position = predict(model, estimate, moved, circumstances(model, estimate, states))[0]
        assert position.shape == (16, 3)


@pytest.fixture
def errors():
    """Two models on poses of different numbers of readings, not in order."""
    rng = np.random.default_rng(4)
    cluster = rng.permutation(np.repeat(np.arange(7), [1, 2, 3, 4, 5, 6, 7]))
    first = rng.random(len(cluster)) * (1 + cluster)
    return [Errors(first, cluster), Errors(0.4 * first + 0.1 * rng.random(len(cluster)), cluster)]


def test_intervals_are_those_of_a_bootstrap_over_whole_poses(errors):
    found, reductions = intervals(errors, 300, np.random.default_rng(5))
    draws, drawn = np.random.default_rng(5), {name: ([], []) for name in METRICS}
    for _ in range(300):
        poses = draws.integers(0, 7, 7)
        for number, one in enumerate(errors):
            distances = np.concatenate([one.distance[one.cluster == pose] for pose in poses])
            drawn["mean_m"][number].append(distances.mean())
            drawn["rms_m"][number].append(np.sqrt(np.mean(distances**2)))
            drawn["p95_m"][number].append(np.quantile(distances, 0.95))
            drawn["max_m"][number].append(distances.max())
    for number in range(2):
        for name in METRICS:
            np.testing.assert_allclose(found[number][name], np.percentile(drawn[name][number], [2.5, 97.5]), rtol=1e-12)
    before, after = map(np.array, drawn["rms_m"])
    np.testing.assert_allclose(reductions[1], np.percentile(1 - after / before, [2.5, 97.5]), rtol=1e-12)
    np.testing.assert_array_equal(reductions[0], 0.0)


def test_intervals_hold_what_they_are_of(errors):
    found, reductions = intervals(errors, 500, np.random.default_rng(6))
    for one, limits in zip(errors, found, strict=True):
        for name, value in summary(one.distance).items():
            assert limits[name][0] <= value <= limits[name][1]
    # Errors that are nearly proportional: the reduction is known far better than either of them.
    assert 0.3 < reductions[1][0] < reductions[1][1] < 0.65
    assert np.ptp(reductions[1]) < 0.2 * np.ptp(found[0]["rms_m"]) / summary(errors[0].distance)["rms_m"]


def test_one_pose_has_no_width():
    found, _ = intervals([Errors(np.array([1.0, 2.0]), np.zeros(2, int))], 50, np.random.default_rng(7))
    assert found[0]["mean_m"].tolist() == [1.5, 1.5]


@pytest.mark.parametrize(("rows", "repeats"), [(3, 3), (6, 1)])
def test_noise_floor_is_what_the_noise_alone_leaves(rows, repeats, fanuc):
    """Readings of the true model: joints that come to rest anew, and a sensor; repeats are averaged."""
    noise = Noise("repeats", 40e-6, 80e-6, np.array([30, 20, 25, 0, 10, 40]) * 1e-6, 1000)
    model = made_model(fanuc.chain, ELBOW_AND_HAND, rows, fitted_frames=False, compliance=fanuc.compliance)
    states = made_states(6, 20, seed=8, repeats=repeats)
    estimate = made_estimate(model, seed=9)
    seen = seen_exactly(model, estimate, states)
    fitted = fit(model, seen, noise, estimate)
    rng, off = np.random.default_rng(10), []
    for _ in range(60):
        rests = noise.joint_rad * rng.standard_normal((repeats, 20, 6))
        moved = [seen_exactly(model, estimate, replace(states, joint_angles=states.joint_angles + rest)) for rest in rests]
        positions = [one.position + noise.position_m * rng.standard_normal(one.position.shape) for one in moved]
        off.append(np.mean(positions, axis=0) - seen.position)
    simulated = np.sqrt((np.array(off) ** 2).sum(axis=-1).mean())
    assert noise_floor(fitted, seen, model, estimate) == pytest.approx(simulated, rel=0.05)


def test_noise_floor_of_a_sensor_alone_is_root_three_of_it(fanuc):
    campaign = planted(fanuc, {}, poses=8)
    fitted = campaign.declared
    floor = noise_floor(fitted, campaign.observations, fitted.model, fitted.estimate)
    assert floor == pytest.approx(np.sqrt(3) * fitted.noise.position_m)


def test_no_noise_floor_where_the_noise_is_unknown(fanuc):
    campaign = planted(fanuc, {}, poses=8)
    fitted = fit(
        campaign.declared.model,
        campaign.observations,
        Noise("residual", 1e-4, 1e-4, np.zeros(6)),
        campaign.declared.estimate,
    )
    assert np.isnan(noise_floor(fitted, campaign.observations, fitted.model, fitted.estimate))


def test_metrics_that_grew_are_named():
    before = dict(zip(METRICS, (1.0, 2.0, 3.0, 4.0), strict=True))
    assert grown(before, before) == []
    assert grown(before, before | {"max_m": 4.1}) == ["max_m"]
    assert grown(before, dict.fromkeys(METRICS, 2.5)) == ["mean_m", "rms_m"]
