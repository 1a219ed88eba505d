"""Keys of features are refused in one line."""

import numpy as np
import pytest
from checked_kinds import describe
from support import refused

from elastocal.measuring.plane import PLANE
from elastocal.measuring.point import POINT
from elastocal.measuring.protocol import find_centre, read_std, span_plane
from elastocal.measuring.sphere import SPHERE


@pytest.mark.parametrize(
    ("kind", "stated", "phrases"),
    [
        (POINT, {"radius_m": 1.0}, ("features.it.radius_m", "position_m, std_m")),
        (POINT, {"position_m": [0, 1]}, ("position_m", "[0, 1]", "three numbers")),
        (POINT, {"position_m": [0, 0, "x"]}, ("position_m", "three numbers")),
        (POINT, {"position_m": [0, 0, 0], "std_m": -1.0}, ("std_m", "0 (exact)")),
        (PLANE, {"normal": [0, 0, 0]}, ("normal", "not zero")),
        (SPHERE, {"radius_m": "big"}, ("radius_m", "'big'", "a number")),
    ],
)
def test_a_key_that_is_wrong_is_refused_with_what_is_allowed(kind, stated, phrases):
    with refused("campaign.yaml", *phrases):
        describe(kind, **stated)


def test_what_is_stated_has_a_standard_deviation_and_exact_values_have_none():
    feature = describe(POINT, position_m=[1, 2, 3])
    np.testing.assert_array_equal(read_std(feature, "std_m", 3), 2e-4)
    assert [unknown.prior_std for unknown in POINT.unknowns(feature)] == [2e-4] * 3
    exact = describe(POINT, position_m=[1, 2, 3], std_m=0)
    assert [unknown.prior_std for unknown in POINT.unknowns(exact)] == [0.0] * 3
    assert [unknown.prior_std for unknown in POINT.unknowns(describe(POINT))] == [
        None
    ] * 3


def test_two_unit_vectors_span_the_plane_of_a_normal():
    normal = np.array([1.0, 2.0, -2.0]) / 3.0
    axes = np.vstack([span_plane(normal), normal])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)


def test_the_centre_of_touched_spheres_is_found_whatever_their_common_radius():
    generator = np.random.default_rng(2)
    centre = np.array([0.4, -0.2, 0.7])
    directions = generator.normal(size=(12, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    touched = centre + 0.05 * directions
    np.testing.assert_allclose(find_centre(touched, np.zeros(12)), centre, atol=1e-12)
    lengths = generator.uniform(0.5, 2.0, 12)
    ends = centre + lengths[:, None] * directions
    np.testing.assert_allclose(find_centre(ends, lengths), centre, atol=1e-12)
