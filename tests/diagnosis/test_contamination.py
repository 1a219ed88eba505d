"""Gross errors compete with effects: accidents are left out, and what an effect explains
stays."""

from dataclasses import replace

import numpy as np
import pytest
from bad_rows import damaged
from made_folders import PLAN, make_folder, make_table

from elastocal.diagnosis import contamination
from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.contamination import (
    compute_agreement_p_value,
    weigh_gross_errors,
    weigh_held_out_rows,
)
from elastocal.diagnosis.fitted_subset import fit_subset
from elastocal.diagnosis.gross_errors import OutlierTest
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model
from elastocal.loop.whole import read_cases

SETTINGS = Settings()
PLAN_OF_POSES = replace(PLAN, poses=40, ladder=(0,), repeats=1, repeated_poses=0)
# Poses whose third joint is bent most.
BEYOND_EDGE = 6


def make_bent_cases(kuka, config_folder, folder, joints):
    """Cases in which the poses with the largest angles of joint 3 err by the angle of a
    joint that grows from an edge on, and the wrong poses.

    `joints` err in turn, from the pose with the largest angle on.
    """
    table = make_table(kuka, "made", plan=PLAN_OF_POSES)
    angle = table["q3"].copy()
    descending = np.sort(np.unique(angle))[::-1]
    edge = descending[BEYOND_EDGE]
    excess = np.maximum(angle - edge, 0.0) / (descending[0] - edge)
    rank = np.searchsorted(-descending, -angle)
    for number, joint in enumerate(joints):
        errs = rank % len(joints) == number
        table[f"q{joint}"] = table[f"q{joint}"] + 4e-4 * excess * errs
    path = make_folder(folder / "made", kuka, table=table)
    poses = np.unique(table["pose"][excess > 0.2])
    return read_cases(path, config_folder / "robots"), poses


def weigh(case, suspects):
    subset = fit_subset(case, ~suspects, SETTINGS)
    return weigh_gross_errors(subset.declared, subset.noise, case, suspects, SETTINGS)


def test_without_suspects_nothing_is_wrong(cases):
    outcome = weigh(cases[0], np.zeros(len(cases[0].campaign.measurements), bool))
    assert not outcome.gross.any()


@pytest.mark.parametrize("shift_m", [2e-3, 0.1, 1e3])
def test_a_wrong_row_is_left_out_and_a_good_suspect_is_not(cases, shift_m):
    case = damaged(cases[0], {11: shift_m})
    suspects = np.zeros(len(case.campaign.measurements), bool)
    suspects[[11, 25, 30]] = True
    outcome = weigh(case, suspects)
    assert np.flatnonzero(outcome.gross).tolist() == [11]
    assert outcome.probability[11] > 0.99
    assert (outcome.probability[[25, 30]] < 0.1).all()


@pytest.mark.parametrize(
    ("sample_share", "most_suspects", "are_fixed"),
    [(1.0, 0.1, False), (0.5, 0.01, False), (0.5, 0.1, True)],
)
def test_effects_found_stay_as_fitted_beside_few_suspects_and_a_sample_of_the_rows(
    cases, monkeypatch, sample_share, most_suspects, are_fixed
):
    """Either way wrong rows are left out and good suspects are not."""
    designs = []

    def build_and_keep(*arguments, **options):
        designs.append(build_candidate_design(*arguments, **options))
        return designs[-1]

    monkeypatch.setattr(contamination, "build_candidate_design", build_and_keep)
    # The second wrong row is so far off that it takes no part.
    case = damaged(cases[0], {11: 2e-3, 17: 1e3})
    key = "joint_offset@3"
    model = case.model.with_effects([case.candidates[key]])
    row = np.arange(len(case.campaign.measurements))
    subset = fit_subset(case, ~np.isin(row, [11, 17]), SETTINGS)
    fitted = fit_model(model, subset.search_sample, subset.noise)
    suspects = np.isin(row, [11, 17, 25, 30])
    assert 0.01 < suspects.mean() < 0.1
    settings = replace(
        SETTINGS,
        gross_start_numbers=int(sample_share * case.model.rows * len(row)),
        gross_error_probability=most_suspects,
    )
    outcome = weigh_gross_errors(fitted, subset.noise, case, suspects, settings)
    assert np.flatnonzero(outcome.gross).tolist() == [11, 17]
    assert (outcome.probability[[25, 30]] < 0.1).all()
    assert len(designs) == 2
    for design in designs:
        assert (key in design.whitened.fixed_keys) == are_fixed


def test_one_effect_beyond_an_edge_wins_over_as_many_accidents(
    kuka, config_folder, tmp_path
):
    (case, _), poses = make_bent_cases(kuka, config_folder, tmp_path, (3,))
    suspects = np.isin(case.campaign.measurements.pose, poses)
    assert suspects.sum() >= 4
    assert not weigh(case, suspects).gross.any()


def test_errors_of_different_joints_beyond_an_edge_are_accidents(
    kuka, config_folder, tmp_path
):
    (case, _), poses = make_bent_cases(kuka, config_folder, tmp_path, (3, 2, 5, 1))
    suspects = np.isin(case.campaign.measurements.pose, poses)
    assert weigh(case, suspects).gross.sum() >= 4


def test_a_wrong_held_out_row_is_left_out_and_a_good_suspect_is_not(cases):
    training, held_out = cases
    held_out = damaged(held_out, {3: 0.01})
    count = len(held_out.campaign.measurements)
    suspects = np.isin(np.arange(count), [3, 7])
    every_row = np.ones(len(training.campaign.measurements), bool)
    subset = fit_subset(training, every_row, SETTINGS)
    outliers = OutlierTest.by_distance(np.zeros((count, 3)), np.zeros(count), suspects)
    outcome = weigh_held_out_rows(
        subset.declared, subset.noise, training, held_out, outliers, SETTINGS
    )
    assert np.flatnonzero(outcome.gross).tolist() == [3]
    assert outcome.distant[7]


def test_errors_that_agree_are_no_accidents_and_those_of_either_sign_are():
    draws = np.random.default_rng(3)
    states = draws.standard_normal((12, 6))
    common = np.tile([0.0, 1.0, 0.2, 0.0, 0.0, 0.0], (12, 1))
    common = common + 0.3 * draws.standard_normal(common.shape)
    assert compute_agreement_p_value(common, states) < SETTINGS.gross_group_level
    p_values = []
    for _ in range(200):
        signs = draws.choice([-1.0, 1.0], (12, 1))
        p_values.append(compute_agreement_p_value(signs * common, states))
    # 95 % of such counts of 200 are at most 15.
    assert np.sum(np.array(p_values) <= 0.05) <= 17
