"""From made posteriors to each of the six verdicts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import made_problem, made_rows, made_unit

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
    UNEXPLAINED,
    concluded,
    hypotheses_of,
)

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
PROBLEM = made_problem(made_rows(), UNITS)[0]
RAISED, SILENT = Alarm(0.002, 9.0, True), Alarm(0.4, -1.0, False)


def made_posterior(*pairs):
    """Of models with their probabilities; "nothing" has what is left."""
    left = 1.0 - sum(probability for _, probability in pairs)
    listed = sorted([*pairs, ((), left)], key=lambda pair: -pair[1])
    models = tuple(Model(tuple(sorted(units)), float(np.log(p + 1e-12)), np.ones(len(units)), 0.0) for units, p in listed)
    return Posterior(models, np.array([probability for _, probability in listed]))


def conclusion(*pairs, alarm=RAISED):
    return concluded(PROBLEM, made_posterior(*pairs), alarm)


def test_without_an_alarm_the_model_is_adequate_whatever_the_posterior_prefers():
    found = conclusion(((OFFSET_2,), 0.9), alarm=SILENT)
    assert found.verdict == ADEQUATE and found.best.mechanisms == () and found.alternatives == {}
    assert found.mechanisms == pytest.approx({"offset": 0.9})


def test_one_mechanism_with_enough_of_the_probability_is_named():
    found = conclusion(((OFFSET_2,), 0.6), ((OFFSET_3,), 0.25), ((PAYLOAD,), 0.1))
    assert found.verdict == NAMED and found.best.mechanisms == ("offset",)
    assert found.best.probability == pytest.approx(0.85) and found.best.model == 0
    # One that is named has no alternatives.
    assert found.alternatives == {"offset": ()}
    assert list(found.mechanisms) == ["offset", "payload"]


def test_the_alarm_decides_that_something_is_missing_and_the_posterior_what():
    """A name needs the probability that is asked for, of which "nothing" has its part, too."""
    found = conclusion(((OFFSET_2,), 0.12), ((PAYLOAD,), 0.02))
    assert found.verdict == CLASS and found.best.mechanisms == ("offset",)


def test_an_ambiguous_mechanism_is_a_class_of_those_worth_a_line():
    found = conclusion(((OFFSET_2,), 0.5), ((PAYLOAD,), 0.3), ((TILT,), 0.19), ((TILT, PAYLOAD), 0.001))
    assert found.verdict == CLASS and found.best.mechanisms == ("offset",)
    assert found.alternatives == {"offset": ("payload", "tilt")}


def test_a_mechanism_beside_the_competitor_is_a_class_with_a_related_one():
    found = conclusion(((OFFSET_3, OTHER_2), 0.9), ((OFFSET_3,), 0.1))
    assert found.verdict == CLASS and found.best.named == ("offset",)
    assert found.alternatives == {"offset": (OTHER,)}


@pytest.mark.parametrize(
    ("sizes", "mechanisms"), [((1.0, 0.1), ("offset",)), ((1.0, 1.0), ("offset", OTHER)), ((0.01, 1.0), (OTHER,))]
)
def test_of_a_law_and_a_smooth_error_that_which_adds_little_is_a_part_of_the_other(sizes, mechanisms):
    """Little is what laws are allowed to be off: of squares, that part which the other cannot make, whatever its size."""
    posterior = Posterior((Model((OFFSET_3, OTHER_2), 1.0, np.array(sizes), 0.0),), np.ones(1))
    (law, law_alone), (unknown, unknown_alone) = squares_beyond(PROBLEM, posterior.models[0], {"offset"})
    small = Settings().law_tolerance ** 2
    assert (unknown_alone < small * law, law_alone < small * unknown) == (OTHER not in mechanisms, "offset" not in mechanisms)
    assert hypotheses_of(PROBLEM, posterior)[0].mechanisms == mechanisms


def test_the_competitor_alone_means_unexplained():
    found = conclusion(((OTHER_1,), 0.4), ((OTHER_1, OTHER_2), 0.3), ((OFFSET_2,), 0.3))
    assert found.verdict == UNEXPLAINED and found.best.mechanisms == (OTHER,) and found.best.named == ()
    assert found.alternatives == {}


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
    assert [(h.mechanisms, pytest.approx(h.probability)) for h in found] == [
        (("offset",), 0.7),
        ((), 0.2),
        ((OTHER,), 0.1),
    ]
    # The most probable of its models stands for each.
    assert [h.model for h in found] == [0, 2, 4]
    assert sum(h.probability for h in found) == pytest.approx(1.0)
