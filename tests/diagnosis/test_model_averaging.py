"""Averages over models."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import make_problem, make_rows, make_term
from scipy.optimize import minimize

from elastocal.diagnosis.evidence import ModelDensity
from elastocal.diagnosis.model_averaging import (
    average_models,
    compute_explained_squares,
    compute_extra_squares,
    is_expected_to_help,
)
from elastocal.diagnosis.search import Posterior, ScoredModel
from elastocal.diagnosis.settings import Settings

SETTINGS = Settings()


TAU = np.array([0.0, 0.3, 0.9])


OWNERS = [("declared", str(number)) for number in range(4)]


def candidate(key, count):
    return SimpleNamespace(
        key=key,
        parameters=[SimpleNamespace(name=str(number)) for number in range(count)],
    )


UNITS = (
    make_term("a", (1,), [0, 1], candidate=candidate("a", 2)),
    make_term("b", (1,), 2, candidate=candidate("b", 1)),
    make_term("other", (1,), [3, 4]),
)


@pytest.fixture(scope="module")
def made():
    """Quiet rows with something of each unit in them, so that the size of the noise is
    at its floor, and their problem."""
    rows = make_rows(1, poses=12)
    noise = 0.5 * (rows.residual - rows.expected)
    rows = replace(
        rows,
        residual=rows.expected
        + noise
        + rows.candidates @ [0.2, -0.1, 0.2, 0.1, 0.0, 0.0],
    )
    problem, products = make_problem(rows, UNITS, tau=TAU)
    return rows, SimpleNamespace(problem=problem, products=products)


def regression(rows, tau, columns, deviations):
    """Mean and covariance of declared parameters, from their present values on, and of
    coefficients: Bayes' rule, dense."""
    left = np.column_stack([rows.declared, rows.candidates[:, columns]])
    prior = np.concatenate([rows.prior_std, deviations])
    center = np.concatenate([-rows.present, np.zeros(len(columns))])
    covariance = rows.covariance(tau) + (left * prior**2) @ left.T
    gain = (prior**2)[:, None] * np.linalg.solve(covariance, left).T
    return center + gain @ (rows.residual - left @ center), np.diag(
        prior**2
    ) - gain @ left * prior**2


def test_moments_of_a_unit_are_averaged_over_its_sizes_and_the_pose_error(made):
    rows, line = made
    problem = line.problem
    unit = UNITS[0]
    base = problem.statistics.log_likelihood + problem.log_pose
    ((mean, variance),) = ModelDensity(
        problem.statistics, [unit], problem.grid, base, np.array([2])
    ).moments()
    weights = []
    means = []
    variances = []
    for tau, log_pose in zip(TAU, problem.log_pose, strict=True):
        for scale, log_weight in zip(
            problem.grid.scales, problem.grid.log_weights, strict=True
        ):
            W = rows.candidates[:, unit.columns]
            covariance = rows.marginal_covariance(tau) + scale**2 * W @ W.T
            y = rows.residual - rows.expected
            log_density = -0.5 * np.linalg.slogdet(covariance)[
                1
            ] - 0.5 * y @ np.linalg.solve(covariance, y)
            weights.append(log_density + log_pose + log_weight)
            found, spread = regression(rows, tau, unit.columns, np.full(2, scale))
            means.append(found[4:])
            variances.append(np.diag(spread)[4:])
    weights = np.exp(np.array(weights) - max(weights))
    weights = (weights / weights.sum())[:, None]
    means = np.array(means)
    variances = np.array(variances)
    expected = (weights * means).sum(axis=0)
    np.testing.assert_allclose(mean, expected, rtol=1e-8)
    np.testing.assert_allclose(
        variance,
        (weights * (variances + (means - expected) ** 2)).sum(axis=0),
        rtol=1e-8,
    )


def posterior_of(*entries):
    models = tuple(
        ScoredModel(units, 0.0, np.array(scales, float), tau)
        for units, scales, tau, _ in entries
    )
    return Posterior(models, np.array([probability for *_, probability in entries]))


def test_declared_parameters_are_averaged_over_all_models(made):
    rows, line = made
    found = posterior_of(
        ((0,), [0.3], 0.0, 0.6), ((), [], 0.3, 0.3), ((1, 2), [1.0, 0.1], 0.9, 0.1)
    )
    result = average_models(line, found, found.models[0], OWNERS)
    means = []
    variances = []
    for model in found.models:
        columns = np.concatenate(
            [
                np.zeros(0, int),
                *(UNITS[number].columns for number in model.term_indices),
            ]
        )
        deviations = np.repeat(
            model.scales, [len(UNITS[number].columns) for number in model.term_indices]
        )
        mean, covariance = regression(rows, model.pose_error_rad, columns, deviations)
        means.append(mean[:4])
        variances.append(np.diag(covariance)[:4])
    means = np.array(means)
    variances = np.array(variances)
    weights = found.probabilities[:, None]
    center = (weights * means).sum(axis=0)
    expected = np.sqrt((weights * (variances + (means - center) ** 2)).sum(axis=0))
    np.testing.assert_allclose(
        [result.shift[owner] for owner in OWNERS],
        center - means[0],
        rtol=1e-6,
        atol=1e-9,
    )
    np.testing.assert_allclose(
        [result.std_error[owner] for owner in OWNERS], expected, rtol=1e-6
    )


def test_coefficients_are_averaged_over_the_models_that_have_them(made):
    """An effect is as large as it is where it is there: models without it do not pull
    it to zero."""
    _, line = made
    best = ((0,), [0.3], 0.0, 0.5)
    alone = posterior_of(best)
    beside = posterior_of(best, ((), [], 0.0, 0.5))
    mine, same = (
        average_models(line, found, found.models[0], OWNERS)
        for found in (alone, beside)
    )
    for name in ("0", "1"):
        assert (
            same.shift["a", name]
            == pytest.approx(mine.shift["a", name])
            == pytest.approx(0.0, abs=1e-12)
        )
        assert same.std_error["a", name] == pytest.approx(mine.std_error["a", name])
    # Beside another unit it may be another size.
    both = posterior_of(best, ((0, 1), [0.3, 1.0], 0.0, 0.5))
    other = average_models(line, both, both.models[0], OWNERS)
    assert abs(other.shift["a", "0"]) > 1e-3
    # What the most probable model does not have is not reported, nor is the competitor.
    assert {owner for owner, _ in other.shift} == {"declared", "a"}
    assert {
        owner for owner, _ in average_models(line, both, both.models[1], OWNERS).shift
    } == {"declared", "a", "b"}


def most_probable(rows, problem, model):
    """Coefficients of a model, dense: at its sizes, and at the pose error that is then
    most probable."""
    columns = np.concatenate(
        [
            np.zeros(0, int),
            *(problem.terms[number].columns for number in model.term_indices),
        ]
    )
    deviations = np.repeat(
        model.scales,
        [len(problem.terms[number].columns) for number in model.term_indices],
    )
    W = rows.candidates[:, columns] * deviations
    y = rows.residual - rows.expected
    densities = []
    for tau, log_pose in zip(TAU, problem.log_pose, strict=True):
        covariance = rows.marginal_covariance(tau) + W @ W.T
        densities.append(
            log_pose
            - 0.5 * np.linalg.slogdet(covariance)[1]
            - 0.5 * y @ np.linalg.solve(covariance, y)
        )
    found = np.zeros(rows.candidates.shape[1])
    found[columns] = regression(
        rows, TAU[int(np.argmax(densities))], columns, deviations
    )[0][4:]
    return found


def projected_gram(rows):
    """Of the columns without what declared parameters can make of them, at no pose
    error, dense."""
    return rows.candidates.T @ np.linalg.solve(
        rows.marginal_covariance(0.0), rows.candidates
    )


@pytest.mark.parametrize("beside", [(), (1,), (1, 2), (0, 1)])
@pytest.mark.parametrize("best", [0.25, 0.45, 0.55, 0.9])
def test_a_model_is_expected_to_help_where_the_expected_square_of_the_error_falls(
    made, best, beside
):
    """What others predict as well helps, however improbable it is by itself."""
    rows, line = made
    problem = replace(line.problem, settings=replace(line.problem.settings, useful=0.0))
    found = posterior_of(
        ((0,), [0.3], 0.0, best), (beside, [0.3] * len(beside), 0.0, 1 - best)
    )
    gram = projected_gram(rows)
    mine, other = (most_probable(rows, problem, model) for model in found.models)
    squares = [
        best * (mine - kept) @ gram @ (mine - kept)
        + (1 - best) * (other - kept) @ gram @ (other - kept)
        for kept in (mine, 0)
    ]
    assert is_expected_to_help(problem, found, found.models[0]) == (
        squares[0] < squares[1]
    )


def test_squares_beyond_the_others_are_what_is_left_where_the_others_fit_them_with_their_priors(
    made,
):
    """As the least penalised sum of squares, found by a search, and all of them where
    nothing else is in the model."""
    rows, _ = made
    problem, _ = make_problem(rows, UNITS, tau=TAU)
    model = ScoredModel((0, 2), 0.0, np.array([0.3, 0.1]), 0.0)
    coefficients = most_probable(rows, problem, model)
    gram = projected_gram(rows)
    mine = UNITS[0].columns
    others = UNITS[2].columns

    def left(values):
        off = np.zeros(len(coefficients))
        off[mine] = coefficients[mine]
        off[others] = -values
        return off @ gram @ off + (values**2).sum() / 0.1**2

    whole, beyond = compute_extra_squares(problem, model, {"a"})[0]
    assert whole == pytest.approx(
        compute_explained_squares(problem, model)["a"], rel=1e-6
    )
    assert beyond == pytest.approx(minimize(left, np.zeros(len(others))).fun, rel=1e-6)
    assert 0.0 < beyond < whole
    assert compute_extra_squares(
        problem, ScoredModel((0,), 0.0, np.array([0.3]), 0.0), {"a"}
    )[0][1] == pytest.approx(
        compute_explained_squares(
            problem, ScoredModel((0,), 0.0, np.array([0.3]), 0.0)
        )["a"]
    )
