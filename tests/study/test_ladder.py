"""The ladder of models, against dense least squares and on a robot with elastic
links."""

import numpy as np
import pytest
from made_study_blocks import PAPER

from elastocal.mechanics.elastostatics import (
    build_extended_chain,
    build_spring_compliance,
    compute_generalized_forces,
)
from elastocal.mechanics.kinematics import compute_jacobians
from elastocal.study.ladder import (
    build_ladder,
    compute_spring_columns,
    form_normal_equations,
)
from elastocal.study.simulation import (
    RandomDesign,
    compute_true_deflections,
    draw_random_experiments,
)

FOLDS = 4


@pytest.fixture(scope="module")
def loaded(kuka_extended):
    drawn = draw_random_experiments(
        RandomDesign(kuka_extended.chain, kuka_extended.joint_limits, PAPER, "x"),
        1,
        "identification",
        range(3),
        24,
    )
    return drawn, compute_spring_columns(kuka_extended, drawn)


def folds_of(columns, deflection):
    return [
        form_normal_equations(columns[:, fold::FOLDS], deflection[:, fold::FOLDS])
        for fold in range(FOLDS)
    ]


def test_columns_times_the_true_compliances_are_the_linear_deflection(
    kuka_extended, loaded
):
    """The springs' own elements in beam axes, against J C J'w of the extended chain."""
    drawn, columns = loaded
    chain = build_extended_chain(kuka_extended)
    n = kuka_extended.joints
    coordinates = np.zeros((*drawn.joint_angles.shape[:-1], chain.coordinates))
    coordinates[..., :n] = drawn.joint_angles
    jacobian = compute_jacobians(chain, coordinates, chain.end_effector)
    springs = compute_generalized_forces(
        jacobian, drawn.wrench
    ) @ build_spring_compliance(kuka_extended)
    expected = (jacobian @ springs[..., None])[..., 0]
    coefficients, *_ = np.linalg.lstsq(
        columns.reshape(-1, columns.shape[-1]), expected.ravel(), rcond=1e-12
    )
    np.testing.assert_allclose(
        columns @ coefficients, expected, atol=1e-6 * np.abs(expected).max()
    )


def test_cross_validation_is_that_of_fits_to_all_other_folds(kuka_extended, loaded):
    """Joints alone, by numpy's least squares for each fold."""
    drawn, columns = loaded
    deflection = compute_true_deflections(
        kuka_extended, drawn, kuka_extended.chain.end_effector, "end_effector"
    )
    ladder = build_ladder(folds_of(columns, deflection), 6, len(kuka_extended.links))
    configuration = np.arange(24)
    total = 0.0
    for fold in range(FOLDS):
        training = configuration % FOLDS != fold
        validation = configuration % FOLDS == fold
        matrix = columns[0, training][..., :6].reshape(-1, 6)
        fitted = np.linalg.lstsq(matrix, deflection[0, training].ravel(), rcond=None)[0]
        total += (
            (deflection[0, validation] - columns[0, validation][..., :6] @ fitted) ** 2
        ).sum()
    assert ladder.cross_validated[0, 0] == pytest.approx(total, rel=1e-6)


def test_the_only_elastic_link_comes_first_and_further_springs_add_nothing(
    kuka_extended, loaded
):
    """The noise is 1 µm and the link deflects by 0.1 mm, so the best of four further links
    reduces the error by chance by a few percent."""
    _, columns = loaded
    weights = np.zeros(columns.shape[-1])
    weights[:6] = kuka_extended.compliance
    weights[6 + 8 * 2 : 6 + 8 * 3] = 1e-6
    noise = 1e-6 * np.random.default_rng(3).standard_normal(columns.shape[:3])
    ladder = build_ladder(
        folds_of(columns, columns @ weights + noise), 6, len(kuka_extended.links)
    )
    assert (ladder.order[:, 0] == 2).all() and (ladder.chosen >= 1).all()
    assert (ladder.cross_validated[:, 0] > 100 * ladder.cross_validated[:, 1]).all()
    assert (
        ladder.cross_validated[:, 1] < 1.1 * ladder.cross_validated.min(axis=1)
    ).all()
