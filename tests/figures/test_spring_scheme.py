"""A spring scheme shows every spring of its robot's model, and no text hides another."""

import pytest
from drawn_figures import texts
from drawn_schemes import DRAWN, assert_no_overlap

from elastocal.figures.spring_scheme import spring_scheme


def test_spring_scheme_has_a_spring_for_each_joint_and_each_elastic_link():
    reduced, extended = texts(spring_scheme(DRAWN["kuka"])), texts(spring_scheme(DRAWN["kuka_extended"]))
    for joint in range(1, 7):
        spring = f"$q_{{{joint}}}$ + $\\theta_{{{joint}}}$"
        assert (reduced.count(spring), extended.count(spring)) == (1, 2)
    # One more in the legend.
    assert (reduced.count("6D"), extended.count("6D")) == (0, len(DRAWN["kuka_extended"].links) + 1)


@pytest.mark.parametrize("robot", DRAWN.values(), ids=DRAWN)
def test_any_serial_chain_draws_without_a_text_on_another(robot):
    assert_no_overlap(spring_scheme(robot))
