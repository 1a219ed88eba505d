"""A kinematic scheme is drawn from its robot's chain: all names are there, and none hides another."""

import pytest
from drawn_schemes import DRAWN, assert_about_160_mm_wide_and_drawn_alike, assert_no_overlap
from matplotlib.text import Text

from elastocal.figures.kinematic_scheme import kinematic_scheme


def labels(figure):
    return {artist.get_gid(): artist.get_text() for artist in figure.findobj(Text) if artist.get_gid()}


@pytest.mark.parametrize("robot", [*DRAWN.values()][::3], ids=[*DRAWN][::3])
def test_any_serial_chain_draws_with_a_name_for_each_joint_and_none_on_another(robot):
    figure = kinematic_scheme(robot)
    assert {f"joint-{n}" for n in range(1, robot.joints + 1)} <= set(labels(figure))
    assert_no_overlap(figure)


def test_the_scheme_is_about_160_mm_wide_and_drawn_alike_each_time():
    assert_about_160_mm_wide_and_drawn_alike(kinematic_scheme)
