"""Models that are left: by dense generalized least squares and normal densities written out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import made_problem, made_rows, made_unit

from elastocal.diagnosis.alternatives import Criterion, Members, _misfits, members_of
from elastocal.diagnosis.search import Model

TAU = np.array([0.0, 0.4])
UNITS = (made_unit("offset", (1,), 0), made_unit("tilt", (1,), [2, 3]), made_unit("sag", (2,), [4, 5]))
# Of the columns of the problem's statistics those that are looked at, in their order: the units' own, without column 1.
COLUMNS = np.array([0, 2, 3, 4, 5])


def posterior_of(rows, factor=1.0, added=0):
    """Three models of two hypotheses after made measurements, and what made them."""
    problem, products = made_problem(rows, UNITS, tau=TAU)
    kept = {
        ("offset",): [Model((0,), 2.0, np.array([0.5]), 0.4), Model((0, 2), 0.5, np.array([0.5, 2.0]), 0.4)],
        ("tilt",): [Model((1,), 1.0, np.array([1.5]), 0.0)],
    }
    evidence = SimpleNamespace(linearized=SimpleNamespace(problem=problem, products=products))
    declared = rows.declared.shape[1]
    instrument = SimpleNamespace(
        columns=COLUMNS, added=np.array([True] * added + [False]), unknowns=declared + len(COLUMNS) + added
    )
    return members_of(evidence, kept, instrument, kept["offset",][0], factor), kept


@pytest.mark.parametrize("factor", [1.0, 1.7])
def test_members_are_the_posteriors_of_dense_generalized_least_squares_at_the_pose_error_of_the_leading_model(factor):
    """Declared parameters integrated over their priors; a larger noise widens every deviation, and so leaves the means."""
    rows = made_rows(1, prior=0.5)
    members, kept = posterior_of(rows, factor)
    covariance, declared = rows.marginal_covariance(0.4), rows.declared.shape[1]
    models = [model for each in kept.values() for model in each]
    for number, model in enumerate(models):
        columns = np.concatenate([UNITS[n].columns for n in model.units])
        deviation = np.repeat(model.scales, [len(UNITS[n].columns) for n in model.units])
        W = rows.candidates[:, columns]
        precision = W.T @ np.linalg.solve(covariance, W) + np.diag(deviation**-2.0)
        mean = np.linalg.solve(precision, W.T @ np.linalg.solve(covariance, rows.residual - rows.expected))
        at = declared + np.searchsorted(COLUMNS, columns)
        np.testing.assert_allclose(members.means[number, at], mean, rtol=1e-8)
        spread = np.linalg.inv(members.precisions[number])[declared:, declared:]
        np.testing.assert_allclose(spread, factor**2 * np.linalg.inv(precision), rtol=1e-8)
        np.testing.assert_array_equal(members.columns[number], np.append(np.arange(declared), at))
        absent = np.setdiff1d(np.arange(members.means.shape[1]), members.columns[number])
        assert len(absent) and not members.means[number, absent].any()


def test_places_of_further_targets_are_unknown_to_a_metre_and_tied_to_nothing():
    plain, with_places = (posterior_of(made_rows(1), added=added)[0] for added in (0, 2))
    for before, after, columns in zip(plain.precisions, with_places.precisions, with_places.columns, strict=True):
        size = len(before)
        np.testing.assert_array_equal(after[:size, :size], before)
        np.testing.assert_array_equal(after[size:], np.eye(size + 2)[size:])
        assert columns[-2:].tolist() == [9, 10]
    assert not with_places.means[:, -2:].any()


def test_drawn_coefficients_have_the_mean_and_covariance_of_the_posterior_and_those_of_other_models_stay_zero():
    """4,000 draws; each moment at 5 standard errors fails by chance once in 3e4 seeds.

    It sees with a power of 0.9 what moves a variance by 14 % or a mean by a tenth of a standard deviation.
    """
    members, _ = posterior_of(made_rows(1))
    draws = 4000
    for model, (columns, precision) in enumerate(zip(members.columns, members.precisions, strict=True)):
        found = members.drawn(model, draws, np.random.default_rng(model))
        covariance = np.linalg.inv(precision)
        size = np.sqrt(np.diag(covariance))
        off = (found[:, columns] - members.means[model, columns]) / size
        assert np.abs(off.mean(axis=0)).max() < 5 / np.sqrt(draws)
        assert np.abs(off.T @ off / draws - covariance / np.outer(size, size)).max() < 5 * np.sqrt(2 / draws)
        assert not np.delete(found, columns, axis=1).any()


def members_like(count, hypotheses, seed=0, certain=None, weights=None):
    """Models of random unknowns, means and precisions."""
    rng, unknowns = np.random.default_rng(seed), 5
    columns, means, precisions, roots = [], np.zeros((count, unknowns)), [], []
    for number in range(count):
        mine = np.sort(rng.choice(unknowns, 2 + number % 3, replace=False))
        half = rng.standard_normal((len(mine), len(mine) + 2))
        precision = half @ half.T if certain is None else certain * np.eye(len(mine))
        columns.append(mine)
        means[number, mine] = rng.standard_normal(len(mine))
        precisions.append(precision)
        roots.append(np.linalg.inv(np.linalg.cholesky(precision)).T)
    weights = rng.dirichlet(np.ones(count)) if weights is None else np.array(weights)
    names = tuple((f"h{number}",) for number in range(max(hypotheses) + 1))
    signs = tuple(np.zeros(len(mine), int) for mine in columns)
    return Members(names, np.array(hypotheses), np.log(weights), tuple(columns), means, tuple(precisions), tuple(roots), signs)


def test_coefficients_have_the_sign_that_physics_gives_wherever_one_in_sixteen_draws_does():
    members = members_like(1, [0], certain=1.0)
    columns, mean = members.columns[0], np.zeros_like(members.means)
    one = replace(members, means=mean, signs=(np.array([1, -1][: len(columns)] + [0] * (len(columns) - 2)),))
    drawn = one.drawn(0, 200, np.random.default_rng(0))[:, columns]
    assert (drawn[:, 0] > 0).all() and (drawn[:, 1] < 0).all()
    np.testing.assert_allclose(np.abs(drawn).mean(axis=0)[:2], np.sqrt(2 / np.pi), rtol=0.15)
    # Where none does, they are as the measurements have them.
    assert (replace(one, means=mean - 20.0 * one.signs[0][0]).drawn(0, 3, np.random.default_rng(0))[:, columns[0]] < 0).all()


def test_misfits_are_the_mean_log_densities_of_measurements_written_out():
    """-2 E ln p_j = ln |C| + tr C^-1 + (A u)' C^-1 A u, with C = I + A_j P_j^-1 A_j', less the number of rows."""
    members, rng = members_like(4, (0, 1, 1, 0)), np.random.default_rng(1)
    # One experiment of a single row, that tells one direction only; one of many.
    designs = [rng.standard_normal((rows, 5)) for rows in (1, 12)]
    truths = rng.standard_normal((3, 5))
    found = _misfits(members, np.array([A.T @ A for A in designs]), truths)
    assert found.shape == (2, 3, 4)
    for experiment, A in enumerate(designs):
        for draw, truth in enumerate(truths):
            for j, (columns, mean, precision) in enumerate(
                zip(members.columns, members.means, members.precisions, strict=True)
            ):
                C = np.eye(len(A)) + A[:, columns] @ np.linalg.solve(precision, A[:, columns].T)
                off = A @ (truth - mean)
                expected = np.linalg.slogdet(C)[1] + np.trace(np.linalg.inv(C)) - len(A) + off @ np.linalg.solve(C, off)
                assert found[experiment, draw, j] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_entropy_left_is_all_of_it_without_information_and_nothing_with_very_much():
    members = members_like(4, (0, 1, 1, 2), seed=2, certain=1e6)
    criterion = Criterion.of(members, np.random.default_rng(3))
    weights = np.exp(members.log_weights)
    each = np.array([weights[0], weights[1] + weights[2], weights[3]])
    none, much = criterion.left(np.array([np.zeros((5, 5)), 1e9 * np.eye(5)]))
    assert none == pytest.approx(-(each * np.log(each)).sum(), rel=1e-9)
    assert much == pytest.approx(0.0, abs=1e-9)


def test_entropy_of_fixed_models_is_that_of_their_bhattacharyya_coefficients():
    """Of known coefficients: sum of w_i ln (1 + w_j / w_i exp(-separation / 8)), with the separation d'G d."""
    members = members_like(2, (0, 1), seed=4, certain=1e12, weights=(0.7, 0.3))
    criterion, rng = Criterion.of(members, np.random.default_rng(5)), np.random.default_rng(6)
    half = rng.standard_normal((5, 5))
    information = np.array([scale * half @ half.T for scale in (0.1, 1.0, 4.0)])
    apart = members.means[0] - members.means[1]
    separation = np.einsum("i,nij,j->n", apart, information, apart)
    close = np.exp(-separation / 8)
    expected = 0.7 * np.log1p(0.3 / 0.7 * close) + 0.3 * np.log1p(0.7 / 0.3 * close)
    np.testing.assert_allclose(criterion.left(information), expected, rtol=1e-4)
    assert separation.min() < 2 < separation.max()
