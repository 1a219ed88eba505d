"""A kinematic scheme is drawn from its robot's chain: all names are there, and none hides another."""

import pytest
from drawn_figures import texts
from drawn_schemes import DRAWN, assert_about_160_mm_wide_and_drawn_alike, assert_no_overlap
from matplotlib.text import Text

from elastocal.figures.kinematic_scheme import kinematic_scheme
from elastocal.mechanics.robot import with_target_offset


def labels(figure):
    return {artist.get_gid(): artist.get_text() for artist in figure.findobj(Text) if artist.get_gid()}


def test_kinematic_scheme_names_all_of_kuka():
    lengths = ("675", "350", "1150", "\N{MINUS SIGN}41", "1200", "240")
    expected = {f"joint-{n}": f"$q_{{{n}}}$" for n in range(1, 7)}
    expected |= {f"length-{n}": f"$l_{{{n}}}$ = {length} mm" for n, length in enumerate(lengths, start=1)}
    expected |= {f"point-{name}": name for name in ("2DoF", "3DoF", "4DoF", "6DoF")}
    figure = kinematic_scheme(DRAWN["kuka"])
    assert labels(figure) == expected
    assert {"base frame", "$x$", "$z$"} <= set(texts(figure))


@pytest.mark.parametrize("robot", [*DRAWN.values()][::3], ids=[*DRAWN][::3])
def test_any_serial_chain_draws_with_a_name_for_each_joint_and_none_on_another(robot):
    figure = kinematic_scheme(robot)
    assert {f"joint-{n}" for n in range(1, robot.joints + 1)} <= set(labels(figure))
    assert_no_overlap(figure)


def test_targets_off_the_chain_draw_apart_from_it():
    assert_no_overlap(kinematic_scheme(with_target_offset(DRAWN["fanuc"], (0.0, 0.1, 0.05))))


def test_the_scheme_is_about_160_mm_wide_and_drawn_alike_each_time():
    assert_about_160_mm_wide_and_drawn_alike(kinematic_scheme)
