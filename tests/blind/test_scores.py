"""Scores of a verdict: its names, its errors, its probabilities and its intervals."""

import numpy as np
import pytest
from made_blind_documents import (
    PLAN,
    make_adequate_verdict,
    make_effect,
    make_oracle,
    make_plain_verdict,
    make_truth,
    make_verdict,
    tabulate_cases,
)

from elastocal_proof.blind.scores import (
    build_case_row,
    compute_rate,
    is_true,
    list_intervals,
    score_probabilities,
)

TILTED = {"misplaced": {"shift_m": [0.0, 0.0, 2e-4], "turn_rad": [3e-4, 0.0, 0.0]}}
PAYLOAD = make_truth(("payload",))
NOTHING = make_truth()
PAIR = make_truth(("payload",), ("joint_tilt", 2), group="pair")
COUNTED = ("detected", "exact", "named_right", "holds_truth", "wrong_name", "remains")
RIGHT = {"detected", "exact", "named_right", "holds_truth"}
# Truth, verdict, and the columns that are true.
OUTCOMES = {
    "a misplaced base is named": (
        make_truth(group="setting") | TILTED,
        make_plain_verdict("named", "base_placement"),
        set(),
    ),
    "a correct base is named": (
        NOTHING,
        make_plain_verdict("named", "base_placement"),
        {"detected", "wrong_name"},
    ),
    "a wrong name besides the misplaced base": (
        NOTHING | TILTED,
        make_plain_verdict("several", "base_placement", "payload"),
        {"detected", "wrong_name"},
    ),
    "the right name besides the misplaced base": (
        PAYLOAD | TILTED,
        make_plain_verdict("several", "base_placement", "payload"),
        RIGHT,
    ),
    "the right name": (PAYLOAD, make_plain_verdict("named", "payload"), RIGHT),
    "a wrong name": (
        PAYLOAD,
        make_plain_verdict("named", "link_weight"),
        {"detected", "wrong_name"},
    ),
    "a class with the truth": (
        PAYLOAD,
        make_plain_verdict("class", "link_weight", alternatives=["payload"]),
        {"detected", "holds_truth"},
    ),
    "a class with a variant of the truth": (
        make_truth(("force_bias",)),
        make_plain_verdict("class", "payload", alternatives=["force_bias[base axes]"]),
        {"detected", "holds_truth"},
    ),
    "a missed effect": (PAYLOAD, make_plain_verdict("adequate"), set()),
    "nothing is missing and nothing is reported": (
        NOTHING,
        make_plain_verdict("adequate"),
        set(),
    ),
    "a false alarm": (
        NOTHING,
        make_plain_verdict("named", "payload"),
        {"detected", "wrong_name"},
    ),
    "one of two effects": (
        PAIR,
        make_plain_verdict("named", "payload"),
        {"detected", "wrong_name"},
    ),
    "both of two effects": (
        PAIR,
        make_plain_verdict("several", "joint_tilt", "payload"),
        {"detected", "exact", "holds_truth"},
    ),
    "a second name that is wrong": (
        PAYLOAD,
        make_plain_verdict("several", "payload", "link_weight"),
        {"detected"},
    ),
    "an unexplained residual": (
        PAYLOAD,
        make_plain_verdict("unexplained", "payload"),
        {"detected"},
    ),
    "two classes with both effects": (
        PAIR,
        make_plain_verdict(
            "several",
            "link_weight",
            "payload",
            alternatives=["payload@2", "joint_tilt@1"],
        ),
        {"detected", "holds_truth"},
    ),
    "two classes with one of two effects": (
        PAIR,
        make_plain_verdict(
            "several", "link_weight", "link_geometry", alternatives=["payload"]
        ),
        {"detected"},
    ),
}


@pytest.mark.parametrize("outcome", OUTCOMES)
def test_a_verdict_is_counted_in_the_right_columns(outcome):
    truth, verdict, expected = OUTCOMES[outcome]
    row = build_case_row(PLAN, truth, verdict)
    assert {column for column in COUNTED if row[column] is True} == expected


@pytest.mark.parametrize(
    ("reduction", "adopted", "expected"),
    [
        ((-0.14, -0.06), True, (True, True)),
        ((-0.25, 0.05), True, (False, True)),
        ((-0.14, -0.06), False, (True, False)),
    ],
)
def test_errors_are_worse_if_they_grow_by_more_than_two_standard_errors(
    reduction, adopted, expected
):
    verdict = make_verdict(
        "named",
        make_effect("payload", adopted=adopted),
        before=1e-4,
        after=1.1e-4,
        reduction=reduction,
    )
    row = build_case_row(PLAN, PAYLOAD, verdict, make_oracle())
    assert (row["worse"], row["adopted"]) == expected


@pytest.mark.parametrize(
    ("located_effect", "expected"),
    [
        (("transmission_harmonic", 2), True),
        (("transmission_harmonic", 3), False),
        (("link_weight", 2), True),
        (("link_weight", 2, 3), False),
    ],
)
def test_an_exact_alias_follows_from_the_effect_and_its_joints(
    located_effect, expected
):
    entry = (make_truth(located_effect), make_adequate_verdict(), make_oracle())
    assert tabulate_cases(entry).exact_alias.tolist() == [expected]


def test_an_arm_without_a_compensator_has_no_alias_of_it():
    truth = make_truth(("transmission_harmonic", 2), robot="xarm7")
    row = build_case_row(PLAN, truth, make_adequate_verdict(), make_oracle())
    assert not row["exact_alias"]


@pytest.mark.parametrize(
    ("alternatives", "expected"), [([], True), (["link_weight"], False), (None, False)]
)
def test_a_case_is_distinguishable_if_the_oracle_excludes_every_other_mechanism(
    alternatives, expected
):
    oracle = make_oracle(alternatives=alternatives)
    row = build_case_row(PLAN, PAYLOAD, make_adequate_verdict(), oracle)
    assert row["distinguishable"] is expected
    assert row["oracle_alternatives"] == " + ".join(alternatives or [])


def test_a_verdict_that_a_fault_of_the_data_ended_has_no_errors_and_states_nothing():
    verdict = make_verdict("named", make_effect("wrong_unit")) | {"heldout": None}
    row = build_case_row(PLAN, PAYLOAD, verdict, None)
    assert not row["worse"]
    for column in ("after_rms_m", "stated", "oracle_rms_m"):
        assert np.isnan(row[column])


OUTSIDE = make_truth(("outside:refraction",), group="outside")
ABSORBED = make_truth(("force_scale",))
ABSORBED["defects"][0]["of"] = "raw"
TWO_OFFSETS = make_truth(
    ("joint_offset", 2), ("joint_offset", 4), group="several_joints"
)


@pytest.mark.parametrize(
    ("truth", "mechanisms", "expected"),
    [
        (PAYLOAD, ("payload",), True),
        (PAYLOAD, ("payload", "joint_tilt"), False),
        # A related mechanism besides the right one is wrong.
        (PAYLOAD, ("payload", "other"), False),
        (PAYLOAD, (), False),
        (NOTHING, (), True),
        (NOTHING, ("other",), False),
        # Outside of the catalogue every set with "other" is true.
        (OUTSIDE, ("payload", "other"), True),
        (OUTSIDE, ("payload",), False),
        (PAIR, ("joint_tilt", "payload"), True),
        (NOTHING | TILTED, ("base_placement",), True),
        (TWO_OFFSETS, ("joint_offset",), True),
        (ABSORBED, (), True),
        (ABSORBED, ("force_scale",), False),
    ],
)
def test_only_the_exact_set_of_mechanisms_is_true(truth, mechanisms, expected):
    assert is_true(mechanisms, truth) == expected


def test_an_effect_that_a_case_hides_is_as_good_as_outside_of_the_catalogue():
    hidden = ("payload", "hysteresis")
    assert is_true(("joint_tilt", "other"), PAYLOAD, hidden)
    assert not is_true(("joint_tilt",), PAYLOAD, hidden)
    assert is_true(("payload",), PAYLOAD, ("hysteresis",))
    sets = [{"mechanisms": ["other"], "probability": 0.9}]
    verdict = {"probabilities": {"sets": sets}}
    assert score_probabilities(PAYLOAD, verdict, hidden)["correct"]
    assert not score_probabilities(PAYLOAD, verdict)["correct"]


@pytest.mark.parametrize(
    ("probabilities", "rank", "expected"),
    [
        ((0.6, 0.3, 0.06, 0.04), 2, True),
        ((0.6, 0.3, 0.06, 0.04), 3, False),
        ((0.6, 0.3), 1, True),
        ((0.97, 0.03), 1, False),
    ],
)
def test_the_credible_set_is_the_smallest_that_reaches_95_per_cent(
    probabilities, rank, expected
):
    """The true mechanism has the given rank among the hypotheses."""
    names = ["a", "b", "c", "d"]
    names[rank] = "payload"
    sets = [
        {"mechanisms": [name], "probability": probability}
        for name, probability in zip(names, probabilities, strict=False)
    ]
    scored = score_probabilities(PAYLOAD, {"probabilities": {"sets": sets[::-1]}})
    assert scored["held"] == expected
    assert scored["stated"] == max(probabilities)
    assert scored["correct"] is False


OFFSET_RAD = 3e-4
OFFSET = make_truth(("joint_offset", 3))
OFFSET["defects"][0]["parameters"] = {"offset": OFFSET_RAD}


def list_effect_intervals(effect, **facts):
    """List the intervals of a verdict on `OFFSET` with one effect, without those of the
    compliances."""
    intervals = list_intervals(OFFSET, make_verdict("named", effect, **facts))
    return [row for row in intervals if row["effect"] != "joint_compliance"]


def make_offset(joint, value_rad, std_error_rad):
    parameters = [("offset", value_rad, std_error_rad)]
    return make_effect("joint_offset", joint, parameters=parameters)


@pytest.mark.parametrize(
    ("value_rad", "expected"),
    [(3.19e-4, True), (3.21e-4, False), (2.81e-4, True), (2.79e-4, False)],
)
def test_an_interval_holds_a_true_value_within_two_standard_errors(value_rad, expected):
    [interval] = list_effect_intervals(make_offset(3, value_rad, 1e-5))
    assert interval["holds"] == expected


@pytest.mark.parametrize(
    "effect",
    [
        make_effect("link_geometry", 3),
        make_offset(4, OFFSET_RAD, 1e-5),
        # A parameter without a standard error was not identified.
        make_offset(3, 0.0, 0.0),
    ],
)
def test_only_identified_parameters_of_the_right_effect_and_joint_have_an_interval(
    effect,
):
    assert not list_effect_intervals(effect)


def test_an_interval_is_wider_if_the_noise_has_few_degrees_of_freedom():
    [interval] = list_effect_intervals(make_offset(3, 3.3e-4, 1e-5), freedom=3)
    assert interval["holds"]


OFFSET_AT_3 = make_truth(("joint_offset", 3))


@pytest.mark.parametrize(
    ("truth", "verdict", "located", "false_mechanism"),
    [
        (
            OFFSET_AT_3,
            make_verdict("named", make_effect("joint_offset", 3)),
            True,
            False,
        ),
        # The right mechanism at a wrong joint is no false mechanism, and does not help.
        (
            OFFSET_AT_3,
            make_verdict("named", make_effect("joint_offset", 4)),
            False,
            False,
        ),
        (
            OFFSET_AT_3,
            make_verdict("named", make_effect("joint_offset", 3, 4)),
            False,
            False,
        ),
        # A mechanism that acts at no joint has no location that could be wrong.
        (PAYLOAD, make_plain_verdict("named", "payload"), True, False),
        (PAYLOAD, make_plain_verdict("named", "link_weight"), False, True),
        (
            PAYLOAD,
            make_plain_verdict("class", "link_weight", alternatives=["payload"]),
            False,
            False,
        ),
        (
            PAYLOAD,
            make_plain_verdict("class", "link_weight", alternatives=["joint_tilt@2"]),
            False,
            True,
        ),
        (
            PAYLOAD,
            make_plain_verdict("several", "payload", "link_weight"),
            False,
            True,
        ),
        (PAIR, make_plain_verdict("named", "payload"), False, False),
        (NOTHING, make_plain_verdict("class", "payload"), False, True),
        (PAYLOAD, make_plain_verdict("unexplained", "link_weight"), False, False),
        (NOTHING, make_adequate_verdict(), False, False),
    ],
)
def test_locations_count_with_the_mechanism_and_false_mechanisms_in_any_statement(
    truth, verdict, located, false_mechanism
):
    row = build_case_row(PLAN, truth, verdict)
    assert (row["located"], row["false_mechanism"]) == (located, false_mechanism)


def test_outcomes_of_one_cluster_count_less_than_independent_ones():
    """Six intervals of a campaign that all miss are one miss."""
    hits = [True] * 60 + [False] * 6
    campaigns = [number // 6 for number in range(66)]
    independent = compute_rate(hits)
    clustered = compute_rate(hits, campaigns)
    assert clustered["rate"] == independent["rate"]
    assert clustered["high"] - clustered["low"] > 1.5 * (
        independent["high"] - independent["low"]
    )
    # The one campaign in eleven has a Clopper-Pearson interval of about this size.
    of_campaigns = compute_rate([True] * 10 + [False])
    assert clustered["low"] == pytest.approx(of_campaigns["low"], abs=0.1)
    # Clusters whose outcomes differ as much as those of any others change nothing.
    mixed = compute_rate([True, False] * 50, [number // 2 for number in range(100)])
    assert mixed["low"] == pytest.approx(compute_rate([True, False] * 50)["low"])
    # Without a miss each cluster counts once.
    assert (
        compute_rate([True] * 66, campaigns)["low"] == compute_rate([True] * 11)["low"]
    )


def test_intervals_of_clustered_outcomes_hold_the_true_share():
    """Coverage of 95 % intervals, 300 samples of 20 clusters of 6 equal outcomes: at
    least 92 %, which a rate of 95 % misses in 2 % of the runs. Intervals of independent
    outcomes hold it in fewer than 75 %."""
    draws = np.random.default_rng(11)
    held = {True: 0, False: 0}
    for _ in range(300):
        hits = np.repeat(draws.random(20) < 0.8, 6)
        for clustered in held:
            clusters = np.repeat(np.arange(20), 6) if clustered else None
            rate = compute_rate(hits, clusters)
            held[clustered] += rate["low"] <= 0.8 <= rate["high"]
    assert held[True] / 300 >= 0.92
    assert held[False] / 300 < 0.75
