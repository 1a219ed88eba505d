"""Shares of the error that physics and a regression explain."""

import numpy as np
import pytest
from made_remainders import smoothly_wrong_cases

from elastocal.fitting.least_squares import fit
from elastocal.fitting.noise import Noise
from elastocal.remainder.corrected import Plan
from elastocal.remainder.shares import remainder_facts

NOISE = Noise("declared", 2e-5, 2e-5, np.zeros(6))


def test_shares_add_up_and_the_reduction_is_that_of_the_errors(kuka, config_folder, tmp_path):
    case, held_out = smoothly_wrong_cases(tmp_path, kuka, config_folder / "robots", poses=60)
    declared = fit(case.model, case.observations, NOISE)
    inside = np.zeros(held_out.observations.cluster.max() + 1, bool)
    plan = Plan("gaussian_process", blocks=False, within_range=True, seed=1)
    facts = remainder_facts(plan, declared, declared, case, held_out, inside, np.random.default_rng(1))
    assert facts["physics"] == 0.0
    assert facts["regression_share"] + facts["left"] == pytest.approx(1.0)
    assert facts["regression_share"] > 0.5
    low, high = facts["reduction_ci95"]
    assert low < 1.0 - np.sqrt(facts["left"]) < high
    assert 0.85 < facts["covered"] <= 1.0 and facts["half_width_m"]["within"] > 3e-5
    assert facts["rms_ci95_m"][0] < facts["errors"]["rms_m"] < facts["rms_ci95_m"][1]
    trees = Plan("extra_trees", blocks=False, within_range=True, seed=1)
    assert remainder_facts(trees, declared, declared, case, held_out, inside, np.random.default_rng(1))["covered"] is None
