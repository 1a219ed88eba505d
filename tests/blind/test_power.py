"""Targets of the blind benchmark state how probable it is to reach them."""

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_blind_documents import PLAN
from scipy.stats import binom

from elastocal_proof.blind.power import compute_power, tabulate_registered_targets
from elastocal_proof.report.blind_page import format_registration

PAGE = ROBOTS.parents[1] / "docs" / "blind_registration.md"
SIZE = "registered"
SEED = 20261130


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ({"high": 0.04}, binom.cdf(8, 200, 0.03)),
        # 190 of 200 are the limit and reach it.
        ({"low": 0.95}, binom.sf(189, 200, 0.03)),
        (
            {"low": 0.02, "high": 0.04},
            binom.cdf(8, 200, 0.03) - binom.cdf(3, 200, 0.03),
        ),
    ],
)
def test_power_is_the_probability_that_the_share_lies_in_the_target(limits, expected):
    power = compute_power(limits | {"acceptable": 0.03}, 200, "acceptable")
    assert power == pytest.approx(expected)
    assert np.isnan(compute_power(limits, 200, "acceptable"))
    assert np.isnan(compute_power(limits | {"acceptable": 0.03}, 0, "acceptable"))


@pytest.fixture(scope="module")
def registered():
    table = tabulate_registered_targets(PLAN, SIZE, SEED)
    return table.dropna(subset="acceptable")


def test_each_registered_target_is_reached_by_good_rates_and_missed_by_bad_ones(
    registered,
):
    assert len(registered) == 19
    assert registered["acceptable_at_1"].min() > 0.93
    assert registered["unacceptable_at_1"].max() < 0.05
    assert registered["acceptable_at_0.5"].min() > 0.85
    assert registered["unacceptable_at_0.5"].max() < 0.11


def test_the_page_of_the_registration_has_the_targets_of_the_plan():
    assert format_registration(PLAN, SIZE, SEED) in PAGE.read_text(encoding="utf-8")
