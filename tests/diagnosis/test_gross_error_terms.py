"""A gross error shifts one row, or all targets of a pose as one error of its angles."""

import numpy as np
import pytest

from elastocal.diagnosis.gross_error_terms import GrossErrorBasis
from elastocal.diagnosis.hypotheses import GROSS_ERROR, build_model_prior
from elastocal.diagnosis.local_effects import LocalEffects
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.linearization import FactoredSensitivities
from elastocal.fitting.observations import separate_measurements

JOINTS = 6
SETTINGS = Settings()


@pytest.fixture
def basis(cases):
    observations = separate_measurements(cases[0].campaign.measurements)
    pose = int(observations.cluster[4])
    no_effects = LocalEffects((), (), (), JOINTS, 1e-4)
    return GrossErrorBasis(
        observations,
        np.array([4, 9]),
        np.array([10.0, 40.0]),
        {pose: 1e-3},
        JOINTS,
        no_effects,
    )


def build_columns(basis):
    observations = basis.observations
    shape = (len(observations), observations.rows, JOINTS + 2)
    jacobian = np.random.default_rng(1).standard_normal(shape)
    columns = FactoredSensitivities.of(
        basis.displacement(shape[2]),
        basis.extend_jacobian(jacobian),
        observations.state,
        len(observations.states),
    )
    return jacobian, columns.dense()


def test_a_row_is_shifted_in_each_component_and_no_other_row_is(basis):
    _, columns = build_columns(basis)
    components = basis.observations.rows
    for number, row in enumerate(basis.suspects):
        shifts = columns[..., number * components : (number + 1) * components]
        np.testing.assert_array_equal(shifts[row], np.eye(components))
        assert not np.delete(shifts, row, axis=0).any()


def test_a_pose_is_displaced_by_its_joint_angles_and_no_other_pose_is(basis):
    jacobian, columns = build_columns(basis)
    (pose,) = basis.pose_sizes_rad
    in_pose = basis.poses == pose
    displaced = columns[..., -JOINTS:]
    np.testing.assert_allclose(displaced[in_pose], jacobian[in_pose][..., :JOINTS])
    assert not displaced[~in_pose].any()


def test_terms_name_their_rows_and_have_their_sizes(basis):
    terms = basis.build_terms(100, len(SETTINGS.scales))
    assert [term.columns[0] for term in terms] == [
        100,
        100 + basis.observations.rows,
        100 + 2 * basis.observations.rows,
    ]
    assert np.flatnonzero(basis.list_shifted(terms[0])).tolist() == [4]
    assert (basis.list_shifted(terms[2]) == (basis.poses == basis.poses[4])).all()
    assert terms[1].sizes[0] == pytest.approx(4.0 * terms[0].sizes[0])


def test_accidents_are_independent(basis):
    terms = basis.build_terms(0, len(SETTINGS.scales))
    prior = build_model_prior(terms, SETTINGS)
    odds = prior.log_odds[GROSS_ERROR]
    np.testing.assert_allclose(np.diff(odds), odds[1])
    assert odds[1] == pytest.approx(np.log(0.01 / 0.99))
