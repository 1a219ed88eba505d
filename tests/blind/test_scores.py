"""Scores count every case, and a case for what it is."""

import pandas as pd
import pytest
from scipy.stats import beta

from elastocal.blind.scores import confused, outcome, summarized


def truth(*effects, group="single", level=50.0):
    case = {"group": group, "robot": "fanuc", "setting": "usual", "effects": effects, "levels": [level] * len(effects)}
    return {"campaign": "case_x", "case": case}


def said(word, *names, alternatives=(), before=2e-4, after=1e-4, warnings=()):
    effects = [{"name": name, "alternatives": list(alternatives)} for name in names]
    errors = {"before": {"rms_m": before}, "after": {"rms_m": after}}
    return {"verdict": word, "effects": effects, "heldout": errors, "warnings": list(warnings)}


OUTCOMES = {
    "right name": (truth("payload"), said("named", "payload"), {"detected", "exact", "named_right", "holds_truth"}),
    "wrong name": (truth("payload"), said("named", "link_weight"), {"detected", "wrong_name"}),
    "class that holds it": (
        truth("payload"),
        said("class", "link_weight", alternatives=["payload"]),
        {"detected", "holds_truth"},
    ),
    "variant among the alternatives": (
        truth("force_bias"),
        said("class", "payload", alternatives=["force_bias[base axes]"]),
        {"detected", "holds_truth"},
    ),
    "missed": (truth("payload"), said("adequate"), set()),
    "silence where nothing is": (truth(group="none"), said("adequate"), set()),
    "false alarm": (truth(group="none"), said("named", "payload"), {"detected", "wrong_name"}),
    "one of two": (truth("payload", "joint_tilt", group="pair"), said("named", "payload"), {"detected", "wrong_name"}),
    "both of two": (
        truth("payload", "joint_tilt", group="pair"),
        said("several", "joint_tilt", "payload"),
        {"detected", "exact", "holds_truth"},
    ),
    "worse in silence": (truth(group="none"), said("adequate", after=3e-4), {"worse_unwarned"}),
    "worse with a warning": (truth(group="none"), said("adequate", after=3e-4, warnings=["it grew"]), set()),
}


@pytest.mark.parametrize("name", OUTCOMES)
def test_outcome_is(name):
    sealed, verdict, expected = OUTCOMES[name]
    row = outcome(sealed, verdict)
    assert {key for key, value in row.items() if value is True} == expected


def test_rates_have_clopper_pearson_intervals():
    cases = pd.DataFrame(
        [outcome(truth("payload"), said("named", "payload"))] * 7 + [outcome(truth("payload"), said("adequate"))] * 3
    )
    row = summarized(cases).set_index("quantity").loc["detected at non-centrality 50"]
    assert (row.hits, row.cases, row.target) == (7, 10, ">= 0.97")
    assert row.low == pytest.approx(beta.ppf(0.025, 7, 4)) and row.high == pytest.approx(beta.ppf(0.975, 8, 3))


def test_every_case_is_in_the_confusion():
    cases = pd.DataFrame([outcome(*entry[:2]) for entry in OUTCOMES.values()])
    table = confused(cases)
    assert table.drop(columns="truth").to_numpy().sum() == len(OUTCOMES)
    assert set(table.truth) == {"payload", "force_bias", "none", "pair"}
