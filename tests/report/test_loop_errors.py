"""Errors stand with their intervals, by step, by split and by range."""

from made_loop_facts import CAMPAIGNS, plainly
from made_loop_tables import remainder_facts, step_rows

from elastocal.report.loop_errors import remainder_sentence
from elastocal.report.loop_errors import step_rows as table_rows


def test_before_and_after_have_intervals_and_multiples():
    table = table_rows(step_rows(), 5e-5)
    assert table["unit"] == "µm" and [row["kind"] for row in table["rows"]] == ["frames", "declared", "effect"]
    cells = table["rows"][0]["cells"]
    assert cells[1] == ["180", "[144, 216]", "3.60 × floor"]
    assert cells[2] == ["270", "≥ 216", "5.40 × floor"]
    assert cells[3] == ["300", "–", "6.00 × floor"]
    assert table_rows(step_rows(largest_m=0.05), None)["rows"][0]["cells"][0] == ["25.000", "[20.000, 30.000]"]


def test_what_a_regression_adds_is_said_with_shares_intervals_and_where_it_corrects_nothing():
    said = plainly(remainder_sentence(remainder_facts(outside=3), CAMPAIGNS["named"]["heldout"]))
    assert "RMS error of 60.0 µm (95 %: 50.0 µm to 72.0 µm) instead of 84.0 µm: a change of the error by −31 to +5 %" in said
    assert "the effects explain 51.0 % and the regression 24.0 %; 25.0 % is left" in said
    assert "± 100 µm within the range of the fitted poses, ± 400 µm outside (median of a coordinate), hold 95 %" in said
    assert "At the 3 poses outside the range of the fitted ones it corrects nothing" in said
    within = plainly(remainder_sentence(remainder_facts(), CAMPAIGNS["named"]["heldout"]))
    assert "outside" not in within
    assert remainder_sentence(None, CAMPAIGNS["named"]["heldout"]) == ""
    none = remainder_sentence(remainder_facts() | {"regression": ""}, CAMPAIGNS["named"]["heldout"])
    assert none.startswith("No regression on what the final model leaves is used")
