"""Posteriors lead to each of the six verdicts, and contradictions are found."""

from collections import defaultdict
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import make_problem, make_rows, make_term
from planted import planted

from elastocal.diagnosis.alarm import Alarm
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.model_averaging import compute_extra_squares
from elastocal.diagnosis.search import Posterior, ScoredModel
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import (
    ADEQUATE,
    CLASS,
    NAMED,
    NOT_TESTABLE,
    SEVERAL,
    UNEXPLAINED,
    Conclusion,
    Hypothesis,
    allow_related_mechanisms,
    compute_location_probabilities,
    conclude,
    find_contradictions,
    rank_hypotheses,
    warn_of_excess_scatter,
)

SETTINGS = Settings()

ROBOT_CANDIDATE = SimpleNamespace(family="geometry")
SETUP_CANDIDATE = SimpleNamespace(family="drift")
TERMS = (
    make_term("offset", (2,), 0, candidate=ROBOT_CANDIDATE),
    make_term("offset", (3,), 1, candidate=ROBOT_CANDIDATE),
    make_term("payload", (), 2, candidate=ROBOT_CANDIDATE),
    make_term("tilt", (2,), 3, candidate=ROBOT_CANDIDATE),
    make_term(OTHER, (1,), 4),
    make_term(OTHER, (2,), 5),
)
OFFSET_2, OFFSET_3, PAYLOAD, TILT, OTHER_1, OTHER_2 = range(6)
ROWS = make_rows()
# The rows contain an offset of joint 3 and a smooth error of joint 2, each of its
# plausible size.
CONTRIBUTIONS = ROWS.candidates[:, [OFFSET_3, OTHER_2]].sum(axis=1)
PROBLEM, _ = make_problem(replace(ROWS, residual=ROWS.expected + CONTRIBUTIONS), TERMS)
# Decisions from probabilities as they are, where each mechanism is significant.
ALL_EFFECTS = ROWS.candidates[:, : OTHER_2 + 1].sum(axis=1)
ALL_ACT, _ = make_problem(
    replace(ROWS, residual=ROWS.expected + 3.0 * ALL_EFFECTS),
    TERMS,
    replace(SETTINGS, confusable_share=0.0),
)
RAISED = Alarm(0.002, 9.0, raised=True)
SILENT = Alarm(0.4, -1.0, raised=False)


def make_posterior(*pairs):
    """A posterior of models, each with its probability; "nothing" has the remaining
    probability."""
    nothing = 1.0 - sum(probability for _, probability in pairs)
    ranked = sorted([*pairs, ((), nothing)], key=lambda pair: -pair[1])
    models = tuple(
        ScoredModel(
            tuple(sorted(terms)),
            float(np.log(probability + 1e-12)),
            np.ones(len(terms)),
            0.0,
        )
        for terms, probability in ranked
    )
    return Posterior(models, np.array([probability for _, probability in ranked]))


@dataclass(frozen=True)
class Expected:
    """A posterior, by its models, and the conclusion from it.

    `models`: probability of each model by the digits of its term indices.
    """

    models: dict[str, float]
    verdict: str
    best: tuple[str, ...]
    alternatives: dict[str, tuple[str, ...]]
    probability: float


CONCLUSIONS = {
    "adequate without an alarm, whatever the posterior prefers": Expected(
        {"0": 0.9}, ADEQUATE, (), {}, 0.1
    ),
    "named with enough probability": Expected(
        {"0": 0.6, "1": 0.25, "2": 0.1}, NAMED, ("offset",), {"offset": ()}, 0.85
    ),
    # The alarm decides that something is missing. Nothing is stated that is less probable
    # than "nothing".
    "an alarm against an improbable mechanism": Expected(
        {"0": 0.12, "2": 0.02}, UNEXPLAINED, (), {}, 0.86
    ),
    "a class of the mechanisms that are worth a line": Expected(
        {"0": 0.5, "2": 0.3, "3": 0.19, "32": 0.001},
        CLASS,
        ("offset",),
        {"offset": ("payload", "tilt")},
        0.99,
    ),
    "no name below 80 % alone, although no competitor is worth a line": Expected(
        {"0": 0.79, "2": 0.015, "3": 0.015, "4": 0.015},
        CLASS,
        ("offset",),
        {"offset": (OTHER,)},
        0.79,
    ),
    "a class below 80 % lists what is worth a line": Expected(
        {"0": 0.76, "2": 0.03, "3": 0.015},
        CLASS,
        ("offset",),
        {"offset": ("payload",)},
        0.79,
    ),
    "a related mechanism in the same model": Expected(
        {"15": 0.9, "1": 0.1}, CLASS, ("offset", OTHER), {"offset": (OTHER,)}, 1.0
    ),
    "a related mechanism in a competing model": Expected(
        {"1": 0.55, "15": 0.45}, CLASS, ("offset",), {"offset": (OTHER,)}, 1.0
    ),
    "several mechanisms, one with an alternative": Expected(
        {"02": 0.7, "03": 0.29},
        SEVERAL,
        ("offset", "payload"),
        {"offset": (), "payload": ("tilt",)},
        0.99,
    ),
    "unexplained if the discrepancy alone is probable": Expected(
        {"4": 0.4, "45": 0.3, "0": 0.3}, UNEXPLAINED, (OTHER,), {}, 0.7
    ),
    "unexplained if no model is better than nothing": Expected(
        {"0": 0.01}, UNEXPLAINED, (), {}, 0.99
    ),
}


@pytest.mark.parametrize("case", CONCLUSIONS)
def test_the_verdict_has_the_least_expected_loss_once_an_alarm_is_raised(case):
    expected = CONCLUSIONS[case]
    models = [(tuple(map(int, key)), share) for key, share in expected.models.items()]
    alarm = SILENT if expected.verdict == ADEQUATE else RAISED
    conclusion = conclude(ALL_ACT, make_posterior(*models), alarm)
    assert conclusion.verdict == expected.verdict
    assert conclusion.best.mechanisms == expected.best
    assert conclusion.alternatives == expected.alternatives
    # Headlines state this probability.
    assert conclusion.probability == pytest.approx(expected.probability)
    inclusion = defaultdict(float)
    for terms, probability in models:
        for name in {TERMS[index].mechanism for index in terms}:
            inclusion[name] += probability
    assert conclusion.mechanisms == pytest.approx(inclusion)
    probabilities = list(conclusion.mechanisms.values())
    assert probabilities == sorted(probabilities, reverse=True)


def test_no_stated_probability_exceeds_one_by_rounding():
    """The probabilities of the models of a mechanism sum to slightly more than one."""
    models = (
        ScoredModel((OFFSET_2,), 9.0, np.ones(1), 0.0),
        ScoredModel((OFFSET_3,), 9.0, np.ones(1), 0.0),
        ScoredModel((), 0.0, np.ones(0), 0.0),
    )
    posterior = Posterior(models, np.array([0.5, 0.5 + 4e-15, 0.0]))
    conclusion = conclude(ALL_ACT, posterior, RAISED)
    assert conclusion.verdict == NAMED
    assert conclusion.probability == 1.0
    assert conclusion.mechanisms["offset"] == 1.0


@pytest.mark.parametrize(
    ("scales", "mechanisms"),
    [
        ((1.0, 0.03), ("offset",)),
        ((1.0, 1.0), ("offset", OTHER)),
        ((0.03, 1.0), (OTHER,)),
    ],
)
def test_a_mechanism_and_a_smooth_error_count_as_one_if_either_adds_little(
    scales, mechanisms
):
    """Little is what modelled laws may be off by: the extra sum of squares, which the
    other one cannot make, whatever the size of the effect."""
    model = ScoredModel((OFFSET_3, OTHER_2), 1.0, np.array(scales), 0.0)
    of_law, of_smooth = compute_extra_squares(PROBLEM, model, {"offset"})
    tolerance = SETTINGS.law_tolerance**2
    smooth_adds_little = of_smooth.extra < tolerance * of_law.total
    law_adds_little = of_law.extra < tolerance * of_smooth.total
    assert smooth_adds_little == (OTHER not in mechanisms)
    assert law_adds_little == ("offset" not in mechanisms)
    posterior = Posterior((model,), np.ones(1))
    assert rank_hypotheses(PROBLEM, posterior)[0].mechanisms == mechanisms


def test_nothing_is_testable_if_only_discrepancies_are_left():
    problem = replace(PROBLEM, terms=TERMS[OTHER_1:])
    conclusion = conclude(problem, make_posterior(((0,), 0.9)), RAISED)
    assert conclusion.verdict == NOT_TESTABLE
    assert conclusion.best.mechanisms == ()


def test_a_test_of_the_set_up_alone_says_nothing_about_the_robot():
    """A step of the set-up can be tested on a single pose. If none is found, the robot
    was not tested; if one is found, it is named."""
    step = make_term("setup_step", (), 0, candidate=SETUP_CANDIDATE)
    problem = replace(ALL_ACT, terms=(step, *TERMS[OTHER_1:]))
    silent = conclude(problem, make_posterior(((0,), 0.1)), SILENT)
    assert silent.verdict == NOT_TESTABLE
    raised = conclude(problem, make_posterior(((0,), 0.9)), RAISED)
    assert raised.verdict == NAMED
    assert raised.best.mechanisms == ("setup_step",)


def test_hypotheses_sum_the_probabilities_of_their_models():
    posterior = make_posterior(
        ((OFFSET_2,), 0.3),
        ((OFFSET_3,), 0.3),
        ((OFFSET_2, OFFSET_3), 0.1),
        ((OTHER_1, OTHER_2), 0.1),
    )
    hypotheses = rank_hypotheses(PROBLEM, posterior)
    assert [h.mechanisms for h in hypotheses] == [("offset",), (), (OTHER,)]
    assert [h.probability for h in hypotheses] == pytest.approx([0.7, 0.2, 0.1])
    # Each hypothesis refers to its most probable model.
    assert [h.model for h in hypotheses] == [0, 2, 4]
    locations = compute_location_probabilities(PROBLEM, posterior, "offset")
    assert locations == pytest.approx({(2,): 4 / 7, (3,): 4 / 7})


@pytest.fixture(scope="module")
def fitted(kuka):
    return planted(kuka, {}, seed=6, poses=8).declared


def test_a_mechanism_of_implausible_size_is_stated_with_a_related_one():
    best = Hypothesis(("joint_offset",), 0.99, 0)
    named = Conclusion(
        NAMED, (best,), best, {"joint_offset": ()}, {"joint_offset": 0.99}, 0.99
    )
    doubted = allow_related_mechanisms(named, {"joint_offset"})
    assert doubted.verdict == CLASS
    assert doubted.alternatives == {"joint_offset": (OTHER,)}
    assert allow_related_mechanisms(doubted, {"joint_offset"}) == doubted
    assert allow_related_mechanisms(named, set()) == named
    several = replace(
        named, verdict=SEVERAL, alternatives={"joint_offset": (), "payload": ()}
    )
    doubted = allow_related_mechanisms(several, {"payload"})
    assert doubted.verdict == SEVERAL
    assert doubted.alternatives == {"joint_offset": (), "payload": (OTHER,)}


def replace_noise(fitted, **changes):
    return replace(fitted, noise=replace(fitted.noise, **changes))


@pytest.mark.parametrize(("factor", "count"), [(4.9, 0), (5.1, 1), (270.0, 1)])
def test_residuals_far_beyond_the_measured_noise_contradict_adequacy(
    fitted, factor, count
):
    measured = replace(fitted.noise, source="repeats")
    scattered = replace_noise(fitted, position_m=factor * fitted.noise.position_m)
    sentences = find_contradictions(scattered, measured, SETTINGS)
    assert len(sentences) == count
    assert all("scatter about the model" in sentence for sentence in sentences)
    declared = replace(measured, source="declared")
    assert find_contradictions(scattered, declared, SETTINGS) == []


@pytest.mark.parametrize(("source", "repeats"), [("declared", 0), ("repeats", 900)])
@pytest.mark.parametrize(("factor", "count"), [(1.0, 0), (1.02, 0), (1.3, 1)])
def test_a_small_excess_over_hundreds_of_numbers_is_no_noise(
    fitted, factor, count, source, repeats
):
    measured = replace(fitted.noise, source=source, degrees_of_freedom=repeats)
    scattered = replace_noise(fitted, position_m=factor * measured.position_m)
    scattered = replace(scattered, residual=np.tile(fitted.residual, (4, 1)))
    sentences = warn_of_excess_scatter(
        scattered, measured, factor, SETTINGS.scatter_level
    )
    assert len(sentences) == count
    assert all("1.30 times" in sentence for sentence in sentences)
    unknown = replace(measured, source="residual")
    assert warn_of_excess_scatter(scattered, unknown, factor, 1.0) == []


@pytest.mark.parametrize(("pose_rad", "count"), [(4e-4, 0), (1e-3, 1)])
def test_a_pose_error_larger_than_that_of_drives_contradicts_adequacy(
    fitted, pose_rad, count
):
    final = replace_noise(fitted, pose_rad=pose_rad)
    sentences = find_contradictions(final, fitted.noise, SETTINGS)
    assert len(sentences) == count
    assert all("1000 µrad" in sentence for sentence in sentences)


@pytest.mark.parametrize(
    ("std_errors", "sentences"),
    [
        (2.5, []),
        (4.5, ["the compliance of joint 3 would be negative by 4.5 standard errors"]),
    ],
)
def test_a_compliance_that_is_negative_beyond_chance_contradicts_adequacy(
    fitted, std_errors, sentences
):
    indices = fitted.parameter_indices("joint_compliance")
    std_error = np.sqrt(np.diag(fitted.covariance))
    beyond_bound = np.zeros(len(std_error))
    beyond_bound[indices[2]] = -std_errors * std_error[indices[2]]
    final = replace(fitted, beyond_bound=beyond_bound)
    assert find_contradictions(final, fitted.noise, SETTINGS) == sentences
