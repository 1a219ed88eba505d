"""Further studies by normal equations against the equations of the study of the tables,
which keeps exact kinematics and orthogonal factors."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from made_studies import USUAL

from elastocal.study.evaluation import average_estimates
from elastocal.study.in_memory import StudyInMemory, StudySize
from elastocal.study.metrics import compute_scores
from elastocal.study.repeated import PrefixEquations, evaluate_studies
from elastocal.study.strategies import strategy_from_document

FOLDER = Path(__file__).resolve().parents[2] / "config" / "strategies"
STRATEGIES = [
    strategy_from_document(yaml.safe_load(path.read_text(encoding="utf-8")))
    for path in sorted(FOLDER.glob("*.yaml"))
]

SIZE = StudySize(data_sets=30, configurations=12, tests=40, noise=2e-4)
TABLE_LENGTH = 10


def study_of(robot, average="stiffness"):
    interpretation = replace(USUAL, average=average)
    return StudyInMemory(robot, "kuka", 1, interpretation, SIZE)


def score_exactly(study, strategy, number, method):
    """Scores of a study by the equations of the study of the tables."""
    blocks = study.estimate_all([strategy], number)[strategy.name]
    validation = study.make_validation_set(number)
    averages = average_estimates(
        [(block, np.ones((1, len(block)))) for block in blocks],
        validation,
        method,
        np.ones((1, study.size.tests)),
    )
    scores = compute_scores(
        averages.compliance[0],
        averages.deviation[0],
        study.robot.compliance,
        strategy.fixed_joints,
    )
    squares = validation.compute_mean_square(np.moveaxis(np.concatenate(blocks), 0, -1))
    return scores | {"mean_square": squares.mean(axis=-1)}


@pytest.mark.parametrize("strategy", STRATEGIES, ids=lambda s: s.name)
def test_scores_are_those_of_exact_kinematics_and_orthogonal_factors(kuka, strategy):
    """The tolerance is the linear model's; the scatter between studies is a hundred times
    as large."""
    study = study_of(kuka)
    (columns,) = evaluate_studies(study, [3], [strategy])
    for method, suffix in (("stiffness", ""), ("compliance", "_mean_compliance")):
        exact = score_exactly(study, strategy, 3, method)
        for name in ("k_sigma", "k_sigma_fixed_joints", "deviation"):
            np.testing.assert_allclose(
                columns[f"{name}{suffix}"][TABLE_LENGTH - 1],
                exact[name][TABLE_LENGTH - 1],
                rtol=2e-3,
                atol=0.02 if name.startswith("k") else 2e-8,
            )
    np.testing.assert_allclose(
        columns["mean_square"][2:], exact["mean_square"][2:], rtol=5e-3
    )


def test_what_equation_12_averages_is_a_setting(kuka):
    (usual,) = evaluate_studies(study_of(kuka), [1], STRATEGIES[:1])
    (other,) = evaluate_studies(study_of(kuka, "compliance"), [1], STRATEGIES[:1])
    np.testing.assert_array_equal(other["k_sigma"], usual["k_sigma_mean_compliance"])
    assert abs(other["k_sigma"][9] - usual["k_sigma"][9]) > 0.1


def test_the_eight_strategies_are_five_estimators(kuka):
    """The paper's "4-6DoF after 6+3DoF" repeats the last normal equations of "3+6DoF
    comb", and the two stages before "6DoF" change nothing."""
    columns = {
        block["strategy"]: block
        for block in evaluate_studies(study_of(kuka), [1], STRATEGIES)
    }
    distinct = {f"{block['mean_square'][-1]:.9e}" for block in columns.values()}
    assert len(columns) == 8
    assert len(distinct) == 5
    np.testing.assert_allclose(
        columns["4-6DoF after 6+3DoF"]["deviation"][2:],
        columns["3+6DoF comb"]["deviation"][2:],
        rtol=1e-9,
    )


def test_cholesky_solves_the_normal_equations_with_some_joints_fixed():
    generator = np.random.default_rng(1)
    rows = generator.standard_normal((12, 4))
    right_side = generator.standard_normal(12)
    matrix = rows.T @ rows
    equations = PrefixEquations(
        {(i, j): np.full((1, 1), matrix[i, j]) for i in range(4) for j in range(i + 1)},
        {i: np.full((1, 1), rows[:, i] @ right_side) for i in range(4)},
    )
    fixed = {1: np.full((1, 1), 0.3)}
    solution = equations.solve([0, 2, 3], fixed)
    expected = np.linalg.lstsq(
        rows[:, [0, 2, 3]], right_side - 0.3 * rows[:, 1], rcond=None
    )[0]
    found = [float(solution[joint][0, 0]) for joint in (0, 2, 3)]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
