"""From made posteriors to each of the six verdicts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import made_problem, made_rows, made_unit
from planted import planted

from elastocal.diagnosis.alarm import Alarm
from elastocal.diagnosis.averaging import squares_beyond
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.search import Model, Posterior
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
    concluded,
    contradictions,
    hypotheses_of,
    location_probabilities,
    pose_error_warnings,
    scatter_warnings,
    with_related,
)
from elastocal.fitting.model import joint_compliances
from elastocal.fitting.noise import Noise

SETTINGS = Settings()

OF_THE_ROBOT, OF_THE_SETUP = SimpleNamespace(family="geometry"), SimpleNamespace(family="drift")
UNITS = (
    made_unit("offset", (2,), 0, candidate=OF_THE_ROBOT),
    made_unit("offset", (3,), 1, candidate=OF_THE_ROBOT),
    made_unit("payload", (), 2, candidate=OF_THE_ROBOT),
    made_unit("tilt", (2,), 3, candidate=OF_THE_ROBOT),
    made_unit(OTHER, (1,), 4),
    made_unit(OTHER, (2,), 5),
)
OFFSET_2, OFFSET_3, PAYLOAD, TILT, OTHER_1, OTHER_2 = range(6)
ROWS = made_rows()
# An offset of joint 3 and a smooth error of joint 2, each of its plausible size.
PROBLEM = made_problem(replace(ROWS, residual=ROWS.expected + ROWS.candidates[:, [OFFSET_3, OTHER_2]].sum(axis=1)), UNITS)[0]
RAISED, SILENT = Alarm(0.002, 9.0, True), Alarm(0.4, -1.0, False)


def made_posterior(*pairs):
    """Of models with their probabilities; "nothing" has what is left."""
    left = 1.0 - sum(probability for _, probability in pairs)
    listed = sorted([*pairs, ((), left)], key=lambda pair: -pair[1])
    models = tuple(Model(tuple(sorted(units)), float(np.log(p + 1e-12)), np.ones(len(units)), 0.0) for units, p in listed)
    return Posterior(models, np.array([probability for _, probability in listed]))


def conclusion(*pairs, alarm=RAISED):
    return concluded(PROBLEM, made_posterior(*pairs), alarm)


# Verdict, best hypothesis, what is meant instead, probability of what is left open; models by the numbers of their units, with
# theirs.
SURE, BOTH = {"offset": ()}, ("offset", "payload")
VERDICTS = {
    "adequate without an alarm, whatever the posterior prefers": (ADEQUATE, (), {}, 0.1, {"0": 0.9}),
    "named with enough of the probability": (NAMED, ("offset",), SURE, 0.85, {"0": 0.6, "1": 0.25, "2": 0.1}),
    # A name needs the probability that is asked for, of which "nothing" has its part, too.
    "the alarm decides that something is missing": (CLASS, ("offset",), SURE, 0.12, {"0": 0.12, "2": 0.02}),
    "a class of those worth a line": (
        *(CLASS, ("offset",), {"offset": ("payload", "tilt")}, 0.99),
        {"0": 0.5, "2": 0.3, "3": 0.19, "32": 0.001},
    ),
    "a related mechanism beside it": (CLASS, ("offset", OTHER), {"offset": (OTHER,)}, 1.0, {"15": 0.9, "1": 0.1}),
    "a related mechanism instead of it alone": (CLASS, ("offset",), {"offset": (OTHER,)}, 1.0, {"1": 0.55, "15": 0.45}),
    "several, each with what is meant instead": (SEVERAL, BOTH, SURE | {"payload": ("tilt",)}, 0.99, {"02": 0.7, "03": 0.29}),
    "unexplained by the competitor alone": (UNEXPLAINED, (OTHER,), {}, 0.7, {"4": 0.4, "45": 0.3, "0": 0.3}),
    "unexplained where nothing is better": (UNEXPLAINED, (), {}, 0.99, {"0": 0.01}),
}


@pytest.mark.parametrize("case", VERDICTS)
def test_the_verdict_is_that_of_least_loss_once_an_alarm_is_raised(case):
    verdict, best, alternatives, probability, named = VERDICTS[case]
    models = [(tuple(map(int, units)), share) for units, share in named.items()]
    found = conclusion(*models, alarm=SILENT if verdict == ADEQUATE else RAISED)
    assert (found.verdict, found.best.mechanisms) == (verdict, best)
    assert {name: tuple(there) for name, there in found.alternatives.items()} == alternatives
    # Without which no headline says how sure it is.
    assert found.probability == pytest.approx(probability)
    inclusion = {}
    for units, probability in models:
        for name in {UNITS[number].mechanism for number in units}:
            inclusion[name] = inclusion.get(name, 0.0) + probability
    assert found.mechanisms == pytest.approx(inclusion)
    assert list(found.mechanisms.values()) == sorted(found.mechanisms.values(), reverse=True)


@pytest.mark.parametrize(
    ("sizes", "mechanisms"), [((1.0, 0.03), ("offset",)), ((1.0, 1.0), ("offset", OTHER)), ((0.03, 1.0), (OTHER,))]
)
def test_of_a_law_and_a_smooth_error_that_which_adds_little_is_a_part_of_the_other(sizes, mechanisms):
    """Little is what laws are allowed to be off: of squares, that part which the other cannot make, whatever its size."""
    posterior = Posterior((Model((OFFSET_3, OTHER_2), 1.0, np.array(sizes), 0.0),), np.ones(1))
    (law, law_alone), (unknown, unknown_alone) = squares_beyond(PROBLEM, posterior.models[0], {"offset"})
    small = SETTINGS.law_tolerance**2
    assert (unknown_alone < small * law, law_alone < small * unknown) == (OTHER not in mechanisms, "offset" not in mechanisms)
    assert hypotheses_of(PROBLEM, posterior)[0].mechanisms == mechanisms


def test_nothing_is_testable_where_only_the_competitor_is_left():
    units = UNITS[OTHER_1:]
    problem = replace(PROBLEM, units=units)
    found = concluded(problem, made_posterior(((0,), 0.9)), RAISED)
    assert found.verdict == NOT_TESTABLE and found.best.mechanisms == ()


def test_a_set_up_that_holds_still_is_no_test_of_the_robot():
    """A step between set-ups can be tested on a single pose: without one, nothing was tested; with one, it has a name."""
    problem = replace(PROBLEM, units=(made_unit("setup_step", (), 0, candidate=OF_THE_SETUP), *UNITS[OTHER_1:]))
    assert concluded(problem, made_posterior(((0,), 0.1)), SILENT).verdict == NOT_TESTABLE
    found = concluded(problem, made_posterior(((0,), 0.9)), RAISED)
    assert found.verdict == NAMED and found.best.mechanisms == ("setup_step",)


def test_hypotheses_gather_locations_laws_and_sum_to_one():
    posterior = made_posterior(((OFFSET_2,), 0.3), ((OFFSET_3,), 0.3), ((OFFSET_2, OFFSET_3), 0.1), ((OTHER_1, OTHER_2), 0.1))
    found = hypotheses_of(PROBLEM, posterior)
    assert [(h.mechanisms, pytest.approx(h.probability)) for h in found] == [(("offset",), 0.7), ((), 0.2), ((OTHER,), 0.1)]
    # The most probable of its models stands for each.
    assert [h.model for h in found] == [0, 2, 4]
    where = location_probabilities(PROBLEM, posterior, "offset")
    assert where == pytest.approx({(2,): 4 / 7, (3,): 4 / 7})


@pytest.fixture(scope="module")
def fitted(kuka):
    return planted(kuka, {}, seed=6, poses=8).declared


def test_a_mechanism_whose_size_is_wrong_is_stated_with_something_related():
    best = Hypothesis(("joint_offset",), 0.99, 0)
    sure = Conclusion("named", (best,), best, {"joint_offset": ()}, {"joint_offset": 0.99}, 0.99)
    doubted = with_related(sure, {"joint_offset"})
    assert (doubted.verdict, doubted.alternatives) == ("class", {"joint_offset": (OTHER,)})
    assert with_related(doubted, {"joint_offset"}) == doubted and with_related(sure, set()) == sure
    both = replace(sure, verdict="several", alternatives={"joint_offset": (), "payload": ()})
    found = with_related(both, {"payload"})
    assert (found.verdict, found.alternatives) == ("several", {"joint_offset": (), "payload": (OTHER,)})


def with_noise(fitted, **changes):
    return replace(fitted, noise=replace(fitted.noise, **changes))


@pytest.mark.parametrize(("factor", "count"), [(4.9, 0), (5.1, 1), (270.0, 1)])
def test_scatter_far_beyond_the_noise_measured_is_one(fitted, factor, count):
    left, repeats = with_noise(fitted, position_m=factor * fitted.noise.position_m), replace(fitted.noise, source="repeats")
    found = contradictions(left, repeats, SETTINGS)
    assert len(found) == count
    assert all("scatter about the model" in sentence for sentence in found)
    assert contradictions(left, replace(repeats, source="declared"), SETTINGS) == []


@pytest.mark.parametrize(("pose_rad", "count"), [(4e-4, 0), (1e-3, 1)])
def test_an_error_of_a_pose_beyond_that_of_drives_is_one(fitted, pose_rad, count):
    found = contradictions(with_noise(fitted, pose_rad=pose_rad), fitted.noise, SETTINGS)
    assert len(found) == count
    assert all("1000 µrad" in sentence for sentence in found)


@pytest.mark.parametrize(
    ("errors", "named"), [(2.5, []), (4.5, ["the compliance of joint 3 is negative by 4.5 standard errors"])]
)
def test_a_compliance_that_is_negative_beyond_chance_is_one(fitted, errors, named):
    mine = np.array([owner == "joint_compliance" for owner, _ in fitted.parameters])
    values = joint_compliances(fitted.model, fitted.estimate).copy()
    values[2] = -errors * np.sqrt(np.diag(fitted.covariance))[mine][2]
    coefficients = tuple(
        values if effect.effect == "joint_compliance" else each
        for effect, each in zip(fitted.model.effects, fitted.estimate.coefficients, strict=True)
    )
    off = replace(fitted, estimate=replace(fitted.estimate, coefficients=coefficients))
    assert contradictions(off, fitted.noise, SETTINGS) == named


@pytest.mark.parametrize(
    ("factor", "source", "words"),
    [
        (1.49, "repeats", None),
        (2.04, "repeats", "2.0 times as much as their repeats about each other"),
        (11.6, "declared", "12 times as much as the noise that is declared for them"),
    ],
)
def test_noise_that_is_much_larger_than_it_was_taken_is_a_warning_from_one_and_a_half_times_on(factor, source, words):
    taken = Noise(source, 6e-5, 6e-5, np.zeros(6))
    found = scatter_warnings(taken.scaled(factor), taken, SETTINGS.relinearize_noise)
    assert found == ([f"measurements scatter about the model {words}"] if words else [])


def test_a_pose_error_is_a_warning_from_the_size_that_repeats_of_a_pose_could_show():
    noise = Noise("declared", 6e-5, 6e-5, np.zeros(6))
    below, above = (pose_error_warnings(replace(noise, pose_rad=size), 2e-5) for size in (1.9e-5, 3.4e-5))
    assert below == [] and len(above) == 1 and "every joint were 34 µrad off" in above[0]
