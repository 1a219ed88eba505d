"""Figures of the loop keep within their pages, and the same tables give the same bytes."""

import pytest
from drawn_figures import assert_nothing_cut_off
from made_loop_tables import candidate_table, residual_table, step_rows
from made_loop_tables import probabilities as stated
from selected import slow_but

from elastocal.figures.candidates import probabilities
from elastocal.figures.residuals import arrows, before_after
from elastocal.figures.style import save

LONG = ("link_elasticity@1+2+3+6[one section]", "force_misalignment[flange axes]", "transmission_harmonic@1[orders 31-36]")
LONG_SETS = [
    ({"link_elasticity": ["links 1 and 2 and 3 and 6 one section"]}, 0.7),
    ({"joint_dependent_stiffness": ["joint 5"], "transmission_harmonic": ["joint 1 orders 1-2", "joint 1 orders 3-6"]}, 0.2),
    ({"other": ["base"]}, 0.1),
]


def of_the_catalogue():
    """A candidates table with the longest names that there are."""
    table = candidate_table()
    table["candidate"][: len(LONG)] = LONG
    return table


FIGURES = {
    "arrows": lambda: arrows(residual_table()),
    "candidates": lambda: probabilities(stated(LONG_SETS), of_the_catalogue()),
    "before_after": lambda: before_after(
        step_rows(effects=("transmission_harmonic@1[orders 31-36], transmission_ratio@2",)), 5e-6
    ),
}


@pytest.mark.parametrize("name", slow_but(["before_after"], FIGURES))
def test_nothing_is_cut_off_and_a_rerun_gives_the_same_bytes(name, tmp_path):
    for run in "ab":
        drawn = FIGURES[name]()
        save(drawn, str(tmp_path / f"{run}.pdf"), str(tmp_path / f"{run}.png"))
    assert_nothing_cut_off(drawn)
    for kind in ("pdf", "png"):
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()
