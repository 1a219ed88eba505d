"""From made posteriors to each of the six verdicts, and what was found in the words and
numbers of verdict.json."""

from dataclasses import replace
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
)
from elastocal.fitting.model import get_joint_compliances

SETTINGS = Settings()

OF_THE_ROBOT = SimpleNamespace(family="geometry")
OF_THE_SETUP = SimpleNamespace(family="drift")
UNITS = (
    make_term("offset", (2,), 0, candidate=OF_THE_ROBOT),
    make_term("offset", (3,), 1, candidate=OF_THE_ROBOT),
    make_term("payload", (), 2, candidate=OF_THE_ROBOT),
    make_term("tilt", (2,), 3, candidate=OF_THE_ROBOT),
    make_term(OTHER, (1,), 4),
    make_term(OTHER, (2,), 5),
)
OFFSET_2, OFFSET_3, PAYLOAD, TILT, OTHER_1, OTHER_2 = range(6)
ROWS = make_rows()
# An offset of joint 3 and a smooth error of joint 2, each of its plausible size.
PROBLEM = make_problem(
    replace(
        ROWS,
        residual=ROWS.expected + ROWS.candidates[:, [OFFSET_3, OTHER_2]].sum(axis=1),
    ),
    UNITS,
)[0]
RAISED = Alarm(0.002, 9.0, raised=True)
SILENT = Alarm(0.4, -1.0, raised=False)


def made_posterior(*pairs):
    """Of models with their probabilities; "nothing" has what is left."""
    left = 1.0 - sum(probability for _, probability in pairs)
    listed = sorted([*pairs, ((), left)], key=lambda pair: -pair[1])
    models = tuple(
        ScoredModel(
            tuple(sorted(units)), float(np.log(p + 1e-12)), np.ones(len(units)), 0.0
        )
        for units, p in listed
    )
    return Posterior(models, np.array([probability for _, probability in listed]))


def conclusion(*pairs, alarm=RAISED):
    return conclude(PROBLEM, made_posterior(*pairs), alarm)


# Verdict, best hypothesis, what is meant instead, probability of what is left open;
# models by the numbers of their units, with theirs.
SURE = {"offset": ()}
BOTH = ("offset", "payload")
VERDICTS = {
    "adequate without an alarm, whatever the posterior prefers": (
        ADEQUATE,
        (),
        {},
        0.1,
        {"0": 0.9},
    ),
    "named with enough of the probability": (
        NAMED,
        ("offset",),
        SURE,
        0.85,
        {"0": 0.6, "1": 0.25, "2": 0.1},
    ),
    # A name needs the probability that is asked for, of which "nothing" has its part,
    # too.
    "the alarm decides that something is missing": (
        CLASS,
        ("offset",),
        SURE,
        0.12,
        {"0": 0.12, "2": 0.02},
    ),
    "a class of those worth a line": (
        *(CLASS, ("offset",), {"offset": ("payload", "tilt")}, 0.99),
        {"0": 0.5, "2": 0.3, "3": 0.19, "32": 0.001},
    ),
    "a related mechanism beside it": (
        CLASS,
        ("offset", OTHER),
        {"offset": (OTHER,)},
        1.0,
        {"15": 0.9, "1": 0.1},
    ),
    "a related mechanism instead of it alone": (
        CLASS,
        ("offset",),
        {"offset": (OTHER,)},
        1.0,
        {"1": 0.55, "15": 0.45},
    ),
    "several, each with what is meant instead": (
        SEVERAL,
        BOTH,
        SURE | {"payload": ("tilt",)},
        0.99,
        {"02": 0.7, "03": 0.29},
    ),
    "unexplained by the competitor alone": (
        UNEXPLAINED,
        (OTHER,),
        {},
        0.7,
        {"4": 0.4, "45": 0.3, "0": 0.3},
    ),
    "unexplained where nothing is better": (UNEXPLAINED, (), {}, 0.99, {"0": 0.01}),
}


@pytest.mark.parametrize("case", VERDICTS)
def test_the_verdict_is_that_of_least_loss_once_an_alarm_is_raised(case):
    verdict, best, alternatives, probability, named = VERDICTS[case]
    models = [(tuple(map(int, units)), share) for units, share in named.items()]
    found = conclusion(*models, alarm=SILENT if verdict == ADEQUATE else RAISED)
    assert (found.verdict, found.best.mechanisms) == (verdict, best)
    assert {
        name: tuple(there) for name, there in found.alternatives.items()
    } == alternatives
    # Without which no headline says how sure it is.
    assert found.probability == pytest.approx(probability)
    inclusion = {}
    for units, probability in models:
        for name in {UNITS[number].mechanism for number in units}:
            inclusion[name] = inclusion.get(name, 0.0) + probability
    assert found.mechanisms == pytest.approx(inclusion)
    assert list(found.mechanisms.values()) == sorted(
        found.mechanisms.values(), reverse=True
    )


@pytest.mark.parametrize(
    ("sizes", "mechanisms"),
    [
        ((1.0, 0.03), ("offset",)),
        ((1.0, 1.0), ("offset", OTHER)),
        ((0.03, 1.0), (OTHER,)),
    ],
)
def test_of_a_law_and_a_smooth_error_that_which_adds_little_is_a_part_of_the_other(
    sizes, mechanisms
):
    """Little is what laws are allowed to be off: of squares, that part which the other
    cannot make, whatever its size."""
    posterior = Posterior(
        (ScoredModel((OFFSET_3, OTHER_2), 1.0, np.array(sizes), 0.0),), np.ones(1)
    )
    (law, law_alone), (unknown, unknown_alone) = compute_extra_squares(
        PROBLEM, posterior.models[0], {"offset"}
    )
    small = SETTINGS.law_tolerance**2
    assert (unknown_alone < small * law, law_alone < small * unknown) == (
        OTHER not in mechanisms,
        "offset" not in mechanisms,
    )
    assert rank_hypotheses(PROBLEM, posterior)[0].mechanisms == mechanisms


def test_nothing_is_testable_where_only_the_competitor_is_left():
    units = UNITS[OTHER_1:]
    problem = replace(PROBLEM, terms=units)
    found = conclude(problem, made_posterior(((0,), 0.9)), RAISED)
    assert found.verdict == NOT_TESTABLE and found.best.mechanisms == ()


def test_a_set_up_that_holds_still_is_no_test_of_the_robot():
    """A step between set-ups can be tested on a single pose: without one, nothing was
    tested; with one, it has a name."""
    problem = replace(
        PROBLEM,
        terms=(
            make_term("setup_step", (), 0, candidate=OF_THE_SETUP),
            *UNITS[OTHER_1:],
        ),
    )
    assert (
        conclude(problem, made_posterior(((0,), 0.1)), SILENT).verdict == NOT_TESTABLE
    )
    found = conclude(problem, made_posterior(((0,), 0.9)), RAISED)
    assert found.verdict == NAMED and found.best.mechanisms == ("setup_step",)


def test_hypotheses_gather_locations_laws_and_sum_to_one():
    posterior = made_posterior(
        ((OFFSET_2,), 0.3),
        ((OFFSET_3,), 0.3),
        ((OFFSET_2, OFFSET_3), 0.1),
        ((OTHER_1, OTHER_2), 0.1),
    )
    found = rank_hypotheses(PROBLEM, posterior)
    assert [(h.mechanisms, pytest.approx(h.probability)) for h in found] == [
        (("offset",), 0.7),
        ((), 0.2),
        ((OTHER,), 0.1),
    ]
    # The most probable of its models stands for each.
    assert [h.model for h in found] == [0, 2, 4]
    where = compute_location_probabilities(PROBLEM, posterior, "offset")
    assert where == pytest.approx({(2,): 4 / 7, (3,): 4 / 7})


@pytest.fixture(scope="module")
def fitted(kuka):
    return planted(kuka, {}, seed=6, poses=8).declared


def test_a_mechanism_whose_size_is_wrong_is_stated_with_something_related():
    best = Hypothesis(("joint_offset",), 0.99, 0)
    sure = Conclusion(
        "named", (best,), best, {"joint_offset": ()}, {"joint_offset": 0.99}, 0.99
    )
    doubted = allow_related_mechanisms(sure, {"joint_offset"})
    assert (doubted.verdict, doubted.alternatives) == (
        "class",
        {"joint_offset": (OTHER,)},
    )
    assert (
        allow_related_mechanisms(doubted, {"joint_offset"}) == doubted
        and allow_related_mechanisms(sure, set()) == sure
    )
    both = replace(
        sure, verdict="several", alternatives={"joint_offset": (), "payload": ()}
    )
    found = allow_related_mechanisms(both, {"payload"})
    assert (found.verdict, found.alternatives) == (
        "several",
        {"joint_offset": (), "payload": (OTHER,)},
    )


def add_noise(fitted, **changes):
    return replace(fitted, noise=replace(fitted.noise, **changes))


@pytest.mark.parametrize(("factor", "count"), [(4.9, 0), (5.1, 1), (270.0, 1)])
def test_scatter_far_beyond_the_noise_measured_is_one(fitted, factor, count):
    left = add_noise(fitted, position_m=factor * fitted.noise.position_m)
    repeats = replace(fitted.noise, source="repeats")
    found = find_contradictions(left, repeats, SETTINGS)
    assert len(found) == count
    assert all("scatter about the model" in sentence for sentence in found)
    assert (
        find_contradictions(left, replace(repeats, source="declared"), SETTINGS) == []
    )


@pytest.mark.parametrize(("pose_rad", "count"), [(4e-4, 0), (1e-3, 1)])
def test_an_error_of_a_pose_beyond_that_of_drives_is_one(fitted, pose_rad, count):
    found = find_contradictions(
        add_noise(fitted, pose_rad=pose_rad), fitted.noise, SETTINGS
    )
    assert len(found) == count
    assert all("1000 µrad" in sentence for sentence in found)


@pytest.mark.parametrize(
    ("errors", "named"),
    [
        (2.5, []),
        (4.5, ["the compliance of joint 3 is negative by 4.5 standard errors"]),
    ],
)
def test_a_compliance_that_is_negative_beyond_chance_is_one(fitted, errors, named):
    mine = np.array([owner == "joint_compliance" for owner, _ in fitted.parameters])
    values = get_joint_compliances(fitted.model, fitted.estimate).copy()
    values[2] = -errors * np.sqrt(np.diag(fitted.covariance))[mine][2]
    coefficients = tuple(
        values if effect.effect == "joint_compliance" else each
        for effect, each in zip(
            fitted.model.effects, fitted.estimate.coefficients, strict=True
        )
    )
    off = replace(fitted, estimate=replace(fitted.estimate, coefficients=coefficients))
    assert find_contradictions(off, fitted.noise, SETTINGS) == named
