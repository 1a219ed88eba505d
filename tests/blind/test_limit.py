"""The best analyst: Bayes factors are those of normal vectors, and nobody is right more often."""

from dataclasses import replace

import numpy as np
import pytest
from made_blind_documents import PLAN
from scipy.stats import multivariate_normal

from elastocal_proof.blind import limit as module
from elastocal_proof.blind.cases import cases_of, yardstick_of
from elastocal_proof.blind.limit import limit, log_bayes_factors, signals_of
from elastocal_proof.plant.kinds import KINDS

pytestmark = pytest.mark.slow

ROBOTS = "config/robots"
SOME = ("force_bias", "joint_tilt", "setup_step", "tracker_scale")


@pytest.fixture(scope="module")
def cases():
    """A single defect at 200 for each of some kinds, and a pair, on the arm that is solved fastest."""
    parts = [{"robots": ["kuka"], "single": 1, "levels": [200.0], "pair": 1}]
    return cases_of(PLAN | {"sizes": {"some": {"purpose": "limit", "parts": parts}}}, "some", 3)


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(module, "NAMED", SOME)


def test_bayes_factors_are_ratios_of_normal_densities():
    draws = np.random.default_rng(1)
    units = draws.standard_normal((6, 16))
    units /= np.linalg.norm(units, axis=0)
    residuals = draws.standard_normal((6, 3))
    columns = np.array([np.arange(8), np.arange(8, 16)])
    found = log_bayes_factors(units.T @ units, units.T @ residuals, columns, 25.0)
    for number, chosen in enumerate(columns):
        covariance = np.eye(6) + 25.0 / 8 * units[:, chosen] @ units[:, chosen].T
        expected = [
            multivariate_normal.logpdf(r, cov=covariance) - multivariate_normal.logpdf(r, cov=np.eye(6)) for r in residuals.T
        ]
        np.testing.assert_allclose(found[number], expected, rtol=1e-9)


def test_signals_have_length_one_and_a_place_for_each_location_that_shows(cases):
    case = cases[0]
    robot = case.specimen(ROBOTS)
    yardstick = yardstick_of(case, robot)
    signals = signals_of(yardstick, robot, ("setup_step", "joint_tilt", "force_scale"), 1)
    # A scale of the forces is absorbed by the compliances, but for the weights.
    assert [kind for kind in signals.kinds if kind != "force_scale"] == [
        "setup_step",
        *["joint_tilt"] * len(KINDS["joint_tilt"].locations(robot.arm)),
    ]
    np.testing.assert_allclose(np.linalg.norm(signals.units, axis=0), 1.0)


def test_the_residual_of_a_faultless_robot_is_noise_of_size_one(cases):
    case = cases[0]
    robot = case.specimen(ROBOTS)
    residual = yardstick_of(case, robot).residual(robot)
    # Of some 3000 numbers 98 % have a mean square within 1/17 of one, and few are absorbed.
    assert (residual**2).mean() == pytest.approx(1.0, abs=0.08)


@pytest.mark.parametrize("effect", SOME)
def test_a_defect_that_shows_well_is_detected_and_named(cases, few, effect):
    case = next(case for case in cases if case.effects == (effect,))
    found = limit(PLAN, case, ROBOTS)
    assert found["detected"] and found["right"] and found["mechanisms"] == [effect]
    assert found["probability"] > 0.9


def test_a_pair_is_named_and_what_hardly_shows_is_not_detected(cases, few):
    single = next(case for case in cases if case.effects == (SOME[2],))
    both = replace(single, effects=(SOME[0], SOME[2]), levels=(200.0, 200.0), group="pair")
    found = limit(PLAN, both, ROBOTS)
    assert found["right"] and found["mechanisms"] == [SOME[0], SOME[2]]
    assert not limit(PLAN, replace(single, levels=(0.5,)), ROBOTS)["detected"]


def test_a_sixth_of_the_cases_that_targets_compare_with_is_in_the_sample(monkeypatch):
    monkeypatch.setattr(module, "limit", lambda plan, case, robots_folder: {"right": True})

    def in_sample(seed, group="single", level=50.0, of="retained"):
        truth = {
            "case": {
                "key": "k",
                "group": group,
                "robot": "kuka",
                "effects": ["payload"],
                "levels": [level],
                "setting": "usual",
                "seed": seed,
            },
            "defects": [{"of": of}],
        }
        return module.limit_of_sample(PLAN, truth, ROBOTS) is not None

    drawn = sum(in_sample(seed) for seed in range(600))
    # Of a binomial distribution, 99.9 %.
    assert 70 <= drawn <= 131
    chosen = next(seed for seed in range(100) if in_sample(seed))
    assert in_sample(chosen, "pair", 200.0) and in_sample(chosen, level=25.0)
    assert not any((in_sample(chosen, level=200.0), in_sample(chosen, "outside"), in_sample(chosen, of="raw")))
