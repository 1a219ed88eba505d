"""Probabilities of a verdict hold if they follow from the columns, and one altered value
does not."""

import json

import numpy as np
import pytest
from made_audits import altered, failed
from scipy.special import logit, logsumexp
from scipy.stats import multivariate_normal

from elastocal_proof.audit.probabilities import TracedEvidence, check_evidence

EVIDENCE = "results/evidence/cell.json"
VERDICT = "reports/loop/cell/verdict.json"
SETTINGS = {
    "scales": [0.1, 0.3, 1.0],
    "scale_center": 0.1,
    "scale_spread": [3.0, 1.0],
    "pose_repeatability_rad": 5e-5,
    "pose_error_probability": 0.5,
    "mechanism_probability": 0.02,
    "gravity_probability": 0.5,
    "other_probability": 0.15,
    "nothing_probability": 0.25,
    "gross_error_probability": 0.01,
    "further_location": 0.5,
    # Laws are exact, so that probabilities are those of the evidence.
    "law_tolerance": 0.0,
    "smooth_tolerance": 0.5,
    "confusable_share": 0.3,
}
POSE_ERRORS = [0.0, 1e-4]
EFFECTS = 30
MODELS = [["a"], ["a", "b"], ["b"], []]
COLUMNS = {"a": [0], "b": [1, 2]}


def draw_columns():
    """Draw 24 measurements of 8 poses with little noise, so that all densities are
    normal, and two of the first column."""
    draws = np.random.default_rng(5)
    candidates = draws.normal(size=(24, 3))
    return {
        "pose": np.repeat(np.arange(8), 3).tolist(),
        "jacobian": (3e3 * draws.normal(size=(24, 2))).tolist(),
        "declared": draws.normal(size=(24, 2)).tolist(),
        "prior_std": [2.0, 3.0],
        "present": [0.5, 0.0],
        "candidates": candidates.tolist(),
        "residual": (candidates[:, 0] + 0.3 * draws.normal(size=24)).tolist(),
        "degrees_of_freedom": 22,
    }


def compute_log_density(columns, names, scales):
    """Log density of the measurements under all priors, by scipy."""
    values = {name: np.array(value) for name, value in columns.items()}
    same_pose = values["pose"][:, None] == values["pose"]
    covariance = np.eye(len(same_pose))
    covariance += (values["declared"] * values["prior_std"] ** 2) @ values["declared"].T
    for name, scale in zip(names, scales, strict=True):
        of_term = values["candidates"][:, COLUMNS[name]]
        covariance += scale**2 * of_term @ of_term.T
    mean = -values["declared"] @ values["present"]
    by_pose_error = []
    for size in POSE_ERRORS:
        jacobian = size * values["jacobian"]
        total = covariance + same_pose * (jacobian @ jacobian.T)
        by_pose_error.append(
            np.log(0.5) + multivariate_normal(mean, total).logpdf(values["residual"])
        )
    return logsumexp(by_pose_error)


def compute_log_odds(columns, names):
    """Posterior log odds of a model: a sum over all combinations of scales."""
    distance = np.log(np.array(SETTINGS["scales"]) / SETTINGS["scale_center"])
    log_weights = -0.5 * distance**2 - logsumexp(-0.5 * distance**2)
    shape = len(names) * [len(distance)]
    by_scales = [
        log_weights[list(index)].sum()
        + compute_log_density(columns, names, np.array(SETTINGS["scales"])[list(index)])
        for index in np.ndindex(*shape)
    ]
    prior = len(names) * logit(0.02)
    if names:
        prior += logit(0.98**EFFECTS * 0.85) - logit(0.25)
    return logsumexp(by_scales) - compute_log_density(columns, [], []) + prior


def describe_model(names, log_odds):
    """Describe a model with its most probable scales."""
    return {
        "terms": [[*COLUMNS].index(name) for name in names],
        "scales": [{"a": 1.0, "b": 0.1}[name] for name in names],
        "pose_error_rad": 0.0,
        "log_odds": log_odds,
    }


def sum_over_sets(sets, mechanism):
    """Sum the probabilities of the sets with a mechanism."""
    return sum(value for names, value in sets.items() if mechanism in names)


@pytest.fixture
def run_with_evidence(run):
    """Columns, models and a verdict of the campaign `cell`."""
    columns = draw_columns()
    log_odds = np.array([compute_log_odds(columns, names) for names in MODELS])
    terms = [
        {"mechanism": name, "columns": of_term, "signs": len(of_term) * [0]}
        | {"log_prior": 0.0, "smallest": 0, "largest": -1}
        for name, of_term in COLUMNS.items()
    ]
    models = [
        describe_model(names, odds)
        for names, odds in zip(MODELS, log_odds.tolist(), strict=True)
    ]
    document = columns | {
        "settings": SETTINGS,
        "effects": EFFECTS,
        "locations": {"a": 1, "b": 1},
        "pose_error_rad": POSE_ERRORS,
        "terms": terms,
        "models": models,
    }
    probabilities = np.exp(log_odds - logsumexp(log_odds))
    sets = dict(zip(map(tuple, MODELS), probabilities.tolist(), strict=True))
    verdict = {
        "nothing": sets.pop(()),
        "mechanisms": {name: sum_over_sets(sets, name) for name in COLUMNS},
        "sets": [
            {"mechanisms": names, "probability": value} for names, value in sets.items()
        ],
    }
    for file, content in ((EVIDENCE, document), (VERDICT, {"probabilities": verdict})):
        (run.folder / file).parent.mkdir(parents=True)
        (run.folder / file).write_text(json.dumps(content), encoding="utf-8")
    return run


def find_failures(run):
    return failed(check_evidence(run, EVIDENCE, "cell"))


def test_probabilities_follow_from_the_columns(run_with_evidence):
    assert find_failures(run_with_evidence) == []
    trace = TracedEvidence(run_with_evidence.document(EVIDENCE))
    # A single term has one sum over scales, which is exact.
    model = trace.models[0]
    log_odds = trace.compute_log_evidence(model) + trace.compute_log_prior(model)
    log_odds -= trace.compute_log_density([], [])
    assert log_odds == pytest.approx(model["log_odds"], abs=1e-9)


@pytest.mark.parametrize(
    ("file", "at", "change", "expected"),
    [
        (EVIDENCE, ["models", 2, "log_odds"], lambda odds: odds + 0.3, "log odds"),
        (EVIDENCE, ["residual", 4], lambda value: value + 1, "log odds"),
        (
            VERDICT,
            ["probabilities", "mechanisms", "b"],
            lambda value: 1.01 * value,
            "probability of mechanisms",
        ),
        (
            VERDICT,
            ["probabilities", "sets", 0, "probability"],
            lambda value: 0.99 * value,
            "probability of sets",
        ),
        (
            VERDICT,
            ["probabilities", "nothing"],
            lambda value: value + 1e-5,
            "probability of nothing",
        ),
    ],
)
def test_an_altered_value_does_not_hold(run_with_evidence, file, at, change, expected):
    with altered(run_with_evidence.folder, file, at, change):
        failures = find_failures(run_with_evidence)
    assert any(name.startswith(expected) for name in failures)


def test_inexact_laws_temper_the_odds_between_causes(run_with_evidence):
    """Nothing keeps its probability, and the less probable cause gains."""
    document = run_with_evidence.document(EVIDENCE)
    exact = TracedEvidence(document).state_probabilities()
    document["settings"] = SETTINGS | {"law_tolerance": 0.5}
    tempered = TracedEvidence(document).state_probabilities()
    assert tempered[()] == exact[()]
    assert sum(tempered.values()) == pytest.approx(1.0)
    assert tempered[("b",)] > exact[("b",)]


def test_a_campaign_without_evidence_has_nothing_to_check(run):
    (run.folder / EVIDENCE).parent.mkdir(parents=True)
    (run.folder / EVIDENCE).write_text("{}", encoding="utf-8")
    assert find_failures(run) == []
