"""Errors stand with their intervals, by step, by split and by range."""

from made_loop_facts import CAMPAIGNS, facts_of, plainly
from made_loop_tables import remainder_facts, split_rows, step_rows

from elastocal.report.loop_errors import range_sentence, remainder_sentence
from elastocal.report.loop_errors import split_rows as rows_of_splits
from elastocal.report.loop_errors import step_rows as table_rows


def test_before_and_after_have_intervals_and_multiples():
    table = table_rows(step_rows(), 5e-5)
    assert table["unit"] == "µm" and [row["kind"] for row in table["rows"]] == ["frames", "declared", "effect"]
    cells = table["rows"][0]["cells"]
    assert cells[1] == ["180", "[144, 216]", "3.60 × floor"]
    assert cells[2] == ["270", "≥ 216", "5.40 × floor"]
    assert cells[3] == ["300", "–", "6.00 × floor"]
    assert table_rows(step_rows(largest_m=0.05), None)["rows"][0]["cells"][0] == ["25.000", "[20.000, 30.000]"]


def test_errors_of_blocks_stand_beside_those_of_held_out_poses():
    facts = facts_of(CAMPAIGNS["named"])["splits"]
    assert [row["name"] for row in facts["rows"]] == [
        "validation poses",
        "every block of joint space in turn",
        *(f"block of joint space {k}" for k in range(1, 5)),
    ]
    assert facts["rows"][1]["cells"] == [["120", "[96, 156]"], ["80", "[64, 104]"], ["33 %", "[23, 43]"]]
    # One quantity has one interval: that of the table before and after, and of the first page.
    declared = next(step for step in step_rows() if step["kind"] == "declared")
    ends = [f"{1e6 * declared[f'heldout_rms_m_{end}']:.0f}" for end in ("low", "high")]
    assert facts["rows"][0]["cells"][0][1] == f"[{ends[0]}, {ends[1]}]"
    assert facts["rows"][0]["cells"][2][1] == "[15, 32]"
    # Without an effect there is nothing to compare.
    adequate = facts_of(CAMPAIGNS["adequate"])["splits"]
    assert not adequate["changed"] and [len(row["cells"]) for row in adequate["rows"]] == [1] * 6
    many = rows_of_splits(split_rows(blocks=30))
    assert len(many["rows"]) == 2 and many["left_out"] == 30


def test_poses_outside_the_fitted_range_are_told_apart():
    within, outside = (plainly(range_sentence(CAMPAIGNS[name]["heldout"])) for name in ("named", "poses outside the range"))
    assert within.startswith(
        "All 10 validation poses lie within the range of the fitted poses. They are of 9 configurations: joint 1 −85 to 60°, "
        "joint 2 0.00 to 1.50 m. With 95 % confidence at least 74 %"
    )
    assert outside.startswith("3 of 10 validation poses lie outside the range")
    assert "120 µm before and 84.0 µm after outside that range" in outside


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
    assert none.startswith("What the final model leaves shows no pattern") and none.endswith("none is used.")
