"""Stated probabilities against made truths: what is counted as true, how far off they are, and that both can fail."""

import numpy as np
import pandas as pd
import pytest
from made_blind_documents import truth

from elastocal_proof.blind.calibration import (
    by_chance,
    calibration_error,
    credible,
    expected_calibration_error,
    is_true,
)

PAYLOAD = truth(("payload",))
FOREIGN = truth(("outside:refraction",), group="outside")


@pytest.mark.parametrize(
    ("document", "mechanisms", "so"),
    [
        (PAYLOAD, ("payload",), True),
        (PAYLOAD, ("payload", "joint_tilt"), False),
        # A related mechanism is not that one.
        (PAYLOAD, ("payload", "other"), False),
        (PAYLOAD, (), False),
        (truth(), (), True),
        (truth(), ("other",), False),
        (FOREIGN, ("other",), True),
        (FOREIGN, ("payload", "other"), True),
        (FOREIGN, ("payload",), False),
        (truth(("payload",), ("joint_tilt", 2), group="pair"), ("joint_tilt", "payload"), True),
        (truth(("joint_offset", 2), ("joint_offset", 4), group="several_joints"), ("joint_offset",), True),
    ],
)
def test_true_is_the_exact_set_of_mechanisms_and_outside_of_the_catalogue_every_set_with_other(document, mechanisms, so):
    assert is_true(mechanisms, document) == so


def test_what_the_compliances_absorb_counts_as_nothing():
    scale = truth(("force_scale",))
    scale["defects"][0]["of"] = "raw"
    assert is_true((), scale)
    assert not is_true(("force_scale",), scale)


def test_the_credible_set_is_the_smallest_that_reaches_95_per_cent():
    ranked = [(frozenset({name}), share) for name, share in (("a", 0.6), ("b", 0.3), ("c", 0.06), ("d", 0.04))]
    assert [share for _, share in credible(ranked)] == [0.6, 0.3, 0.06]
    assert len(credible(ranked[:2])) == 2
    assert len(credible([(frozenset(), 0.97), (frozenset({"a"}), 0.03)])) == 1


def test_the_error_is_the_mean_distance_in_bins_weighted_by_their_cases():
    probability = np.array([0.95] * 10 + [0.55] * 5)
    correct = np.array([True] * 9 + [False] + [True] * 4 + [False])
    assert expected_calibration_error(probability, correct) == pytest.approx((10 * 0.05 + 5 * 0.25) / 15)
    # A certain statement belongs to the last bin.
    assert expected_calibration_error(np.ones(4), np.array([True] * 4)) == 0.0


def test_calibrated_statements_have_the_error_of_chance_and_overconfident_ones_more():
    """Of 2,000 cases: by chance about 1.5 %; statements whose odds are squared are off by over 8 %, five times as much."""
    rng = np.random.default_rng(5)
    probability = rng.uniform(0.3, 1.0, 2000)
    correct = rng.random(2000) < probability
    chance = by_chance(probability, rng)
    assert 0.005 < chance < 0.025
    assert expected_calibration_error(probability, correct) < 2 * chance
    bold = probability**2 / (probability**2 + (1 - probability) ** 2)
    assert expected_calibration_error(bold, correct) > 0.08


@pytest.mark.slow
def test_the_interval_of_the_error_holds_a_miscalibration_that_is_known():
    """Stated 0.9 and true in 0.8: an error of 0.1, which 100 samples of 400 cases hold in at least 88; the power to see a
    nominal 80 % interval instead is over 95 %."""
    rng, held = np.random.default_rng(6), 0
    for seed in range(100):
        rows = pd.DataFrame({"stated": 0.9, "correct": rng.random(400) < 0.8})
        found = calibration_error(rows, seed)
        held += found["low"] <= 0.1 <= found["high"]
    assert held >= 88
