"""A robot is seen from the side and a little from above."""

import numpy as np

from elastocal.figures.arm_view import draw_arm, project_view
from elastocal.figures.style import panels


def test_up_is_up_and_what_lies_farther_away_is_higher():
    """The view keeps lengths at right angles to it, and a turn by 90 degrees about the vertical moves what was near away."""
    np.testing.assert_allclose(project_view(np.zeros(3)), 0.0)
    up = project_view(np.array([0.0, 0.0, 1.0]))
    assert up[0] == 0.0 and 0.9 < up[1] < 1.0
    ahead = np.array([np.cos(np.radians(-60.0)), np.sin(np.radians(-60.0)), 0.0])
    assert abs(project_view(ahead)[0]) < 1e-12 and project_view(ahead)[1] < 0 < project_view(-ahead)[1]
    aside = np.array([-ahead[1], ahead[0], 0.0])
    np.testing.assert_allclose(project_view(aside), [1.0, 0.0], atol=1e-12)


def test_an_arm_stands_on_its_base_and_has_a_shadow_on_its_plane():
    _, axes = panels(1, 1, 40)
    draw_arm(axes[0, 0], np.array([[0.2, 0.0, 0.5], [1.0, 0.0, 0.5]]), 5)
    shadow, edge, arm = (line.get_xydata() for line in axes[0, 0].lines)
    np.testing.assert_allclose(arm[0], 0.0)
    np.testing.assert_allclose(edge, arm)
    np.testing.assert_allclose(shadow[-1], project_view(np.array([1.0, 0.0, 0.0])))
