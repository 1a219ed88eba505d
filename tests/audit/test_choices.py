"""Choices among candidates against what is known of small ones."""

from itertools import combinations

import numpy as np
import pytest
from made_audits import CONFIGURATION

from elastocal_proof.audit.audited import Audited
from elastocal_proof.audit.choices import _best_weights, _error, _exchange, _least_squares, _springs, _taken, _value
from elastocal_proof.audit.streams import draw

# A cantilever that is askew to the axes of its chain, behind a joint.
BENT = {
    "name": "bent",
    "chain": "Rz(q1) Tx(0.8) Ty(0.5) [tip]",
    "compliance_urad_per_Nm": [0.4],
    "links": {"youngs_modulus_GPa": 70, "shear_modulus_GPa": 26, "tubes": [{"outer_diameter_m": 0.1, "wall_m": 0.01}]},
}


@pytest.fixture
def candidates():
    rows = np.random.default_rng(3).normal(size=(12, 2, 3)) * [1.0, 3.0, 0.5]
    return np.einsum("cki,ckj->cij", rows, rows), np.diag([1.0, 2.0, 5.0])


def test_the_design_chosen_is_the_best_of_all(candidates):
    products, weight = candidates
    best = min(combinations(range(12), 3), key=lambda some: _error(products[list(some)], weight))
    assert sorted(_exchange(products, 3, _value("I", weight))) == list(best)


def test_no_design_is_better_than_the_best_weights_and_none_of_them_better_than_one_of_many(candidates):
    products, weight = candidates
    least = _best_weights(products, 3, weight)
    errors = [_error(products[list(some)], weight) for some in combinations(range(12), 3)]
    assert 0.8 * min(errors) < least < min(errors)


@pytest.mark.parametrize("kind", "DAI")
def test_criteria_of_a_diagonal_matrix(kind):
    expected = {"D": np.log(24), "A": -(1 / 2 + 1 / 3 + 1 / 4) / 3, "I": -(1 / 2 + 2 / 3 + 5 / 4)}
    assert _value(kind, np.diag([1.0, 2.0, 5.0]))(np.diag([2.0, 3.0, 4.0])) == pytest.approx(expected[kind])


def test_springs_of_a_link_are_those_of_a_beam(tmp_path):
    """Under a small load the deflection is the columns times L / EA, L^3 / 3EI, L / GJ, L / EI and L^2 / 2EI."""
    settings = CONFIGURATION | {"loading": {"force_N": 1e-3, "offset_m": [0, 0.5, 0]}}
    run = Audited(tmp_path, settings, {"bent": BENT}, {}, 4)
    columns, moved = _springs(run, "bent", 0, 5)
    length, area, second = np.hypot(0.8, 0.5), np.pi * (0.1**2 - 0.08**2) / 4, np.pi * (0.1**4 - 0.08**4) / 64
    bending = 70e9 * second
    tube = [length / (70e9 * area), *2 * [length**3 / (3 * bending)], length / (52e9 * second), *2 * [length / bending]]
    expected = columns @ [0.4e-6, *tube, length**2 / (2 * bending), -(length**2) / (2 * bending)]
    np.testing.assert_allclose(moved, expected, rtol=1e-5, atol=1e-7 * np.abs(moved).max())
    assert _taken(run.arm("bent"), [0]).tolist() == list(range(9))


def test_least_squares_leave_what_is_not_taken_at_zero():
    rng = np.random.default_rng(1)
    columns, right = rng.normal(size=(6, 6, 4)), rng.normal(size=(6, 6))
    found = _least_squares(columns, right, np.array([0, 2]))
    expected = np.linalg.lstsq(columns.reshape(36, 4)[:, [0, 2]], right.ravel(), rcond=None)[0]
    np.testing.assert_allclose(found[[0, 2]], expected, rtol=1e-8)
    assert found[[1, 3]].tolist() == [0, 0]


def test_candidates_within_the_limits_are_drawn_from_a_stream_of_their_own(tmp_path):
    limited = BENT | {"joint_limits_deg": [[-10, 10]]}
    run = Audited(tmp_path, CONFIGURATION, {"bent": limited}, {}, 4)
    ours, theirs = (np.array(draw(run, "bent", 0, 50, purpose=name, joint_range="limits")[0]) for name in ("one", "other"))
    assert np.abs(ours).max() <= np.deg2rad(10)
    assert not np.isclose(ours, theirs).any()
