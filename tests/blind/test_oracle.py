"""The oracle knows the effect and its joints and is judged like the diagnosis; the best
analyst is right more often than anyone else."""

import json
from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_blind_documents import PLAN
from scipy.stats import multivariate_normal

from elastocal.effects.catalogue import candidates_on
from elastocal.loop.whole import diagnose_folder
from elastocal.mechanics.sites import build_sites
from elastocal_proof.blind import oracle as module
from elastocal_proof.blind.cases import BlindCase, list_cases, write_sealed_case
from elastocal_proof.blind.oracle import (
    assess_best_analyst,
    assess_sampled_case,
    compute_log_bayes_factors,
    fit_oracle,
    list_variants,
)


@pytest.fixture
def list_keys(kuka):
    """List the keys of the candidates of each variant of an effect at some joints."""
    candidates = candidates_on(build_sites(kuka)).values()

    def keys_of(variant):
        return [candidate.key for candidate in variant]

    def list_keys(effect, joints):
        return [*map(keys_of, list_variants(effect, joints, candidates))]

    return list_keys


def test_a_variant_consists_of_the_candidates_at_the_true_joints(list_keys):
    assert list_keys("joint_offset", (3,)) == [["joint_offset@3"]]
    [weights] = list_keys("link_weight", (2, 3))
    locations = {key.partition("[")[0] for key in weights}
    assert locations == {"link_weight@2", "link_weight@3"}


def test_the_oracle_fits_what_the_diagnosis_names_rightly(tmp_path):
    # The arm weighs nothing, so that the diagnosis is fast.
    setting = "weight_compensated"
    case = BlindCase(
        f"joint_offset/{setting}",
        "single",
        "kuka",
        ("joint_offset",),
        (200.0,),
        setting,
        271828,
        changes=PLAN["settings"][setting],
    )
    write_sealed_case(case, tmp_path / "blind", tmp_path / "sealed", ROBOTS)
    sealed = tmp_path / "sealed" / f"{case.name}.json"
    truth = json.loads(sealed.read_text(encoding="utf-8"))
    folder = (tmp_path / "blind" / case.name).as_posix()
    verdict = diagnose_folder(folder, ROBOTS.as_posix(), 1)
    assert [effect["name"] for effect in verdict["effects"]] == ["joint_offset"]
    informed = fit_oracle(truth, verdict, folder, ROBOTS.as_posix(), 1)
    [joint] = truth["defects"][0]["joints"]
    assert informed["candidates"] == [f"joint_offset@{joint}"]
    assert informed["detected"]
    assert informed["p_value"] < 1e-6
    # The diagnosis has a prior of the size and estimates the pose error; both change
    # the errors very little here.
    assert informed["heldout"] == pytest.approx(verdict["heldout"]["after"], rel=2e-3)
    # Without an effect the oracle has the declared model.
    without_effect = fit_oracle({"defects": []}, verdict, folder, ROBOTS.as_posix(), 1)
    assert without_effect["heldout"] == verdict["heldout"]["declared"]
    assert not without_effect["detected"]


SELECTED_EFFECTS = ("force_bias", "joint_tilt", "setup_step", "tracker_scale")


@pytest.fixture(scope="module")
def cases():
    """Single effects at 200, and a pair, on the arm that is solved fastest."""
    parts = [{"robots": ["kuka"], "single": 1, "levels": [200.0], "pair": 1}]
    sizes = {"some": {"purpose": "limit", "parts": parts}}
    return list_cases(PLAN | {"sizes": sizes}, "some", 3)


@pytest.fixture
def few_hypotheses(monkeypatch):
    monkeypatch.setattr(module, "CATALOGUE_EFFECTS", SELECTED_EFFECTS)


@pytest.mark.slow
def test_bayes_factors_are_ratios_of_normal_densities():
    draws = np.random.default_rng(1)
    signals = draws.standard_normal((6, 16))
    signals /= np.linalg.norm(signals, axis=0)
    residuals = draws.standard_normal((6, 3))
    columns = np.array([np.arange(8), np.arange(8, 16)])
    log_factors = compute_log_bayes_factors(
        signals.T @ signals, signals.T @ residuals, columns, 25.0
    )
    noise = multivariate_normal(cov=np.eye(6))
    for hypothesis, chosen in enumerate(columns):
        covariance = np.eye(6) + 25.0 / 8 * signals[:, chosen] @ signals[:, chosen].T
        defect = multivariate_normal(cov=covariance)
        expected = defect.logpdf(residuals.T) - noise.logpdf(residuals.T)
        np.testing.assert_allclose(log_factors[hypothesis], expected, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("effect", SELECTED_EFFECTS)
@pytest.mark.usefixtures("few_hypotheses")
def test_a_clearly_visible_defect_is_detected_and_named(cases, effect):
    case = next(case for case in cases if case.effects == (effect,))
    conclusion = assess_best_analyst(PLAN, case, ROBOTS)
    assert conclusion["detected"]
    assert conclusion["right"]
    assert conclusion["mechanisms"] == [effect]
    assert conclusion["probability"] > 0.9


@pytest.mark.slow
@pytest.mark.usefixtures("few_hypotheses")
def test_a_pair_is_named_and_a_hardly_visible_defect_is_not_detected(cases):
    first, _, second, _ = SELECTED_EFFECTS
    single = next(case for case in cases if case.effects == (second,))
    pair = replace(single, effects=(first, second), levels=(200.0, 200.0), group="pair")
    conclusion = assess_best_analyst(PLAN, pair, ROBOTS)
    assert conclusion["right"]
    assert conclusion["mechanisms"] == [first, second]
    weak = replace(single, levels=(0.5,))
    assert not assess_best_analyst(PLAN, weak, ROBOTS)["detected"]


@pytest.mark.slow
def test_a_sixth_of_the_cases_with_a_target_is_in_the_sample(monkeypatch):
    monkeypatch.setattr(
        module, "assess_best_analyst", lambda plan, case, robots_folder: {"right": True}
    )

    def is_sampled(seed, group="single", level=50.0, of="retained"):
        case = {
            "key": "k",
            "group": group,
            "robot": "kuka",
            "effects": ["payload"],
            "levels": [level],
            "setting": "usual",
            "seed": seed,
        }
        truth = {"case": case, "defects": [{"of": of}]}
        return assess_sampled_case(PLAN, truth, ROBOTS) is not None

    # These limits hold 99.9 % of a binomial distribution.
    assert 70 <= sum(is_sampled(seed) for seed in range(600)) <= 131
    sampled = next(seed for seed in range(100) if is_sampled(seed))
    assert is_sampled(sampled, "pair", 200.0)
    assert is_sampled(sampled, level=25.0)
    assert not is_sampled(sampled, level=200.0)
    assert not is_sampled(sampled, "outside")
    assert not is_sampled(sampled, of="raw")
