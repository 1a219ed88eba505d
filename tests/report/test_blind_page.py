"""The page of targets has one row for each quantity, with its robots and its limit."""

import pandas as pd
from made_blind_documents import (
    PLAN,
    make_adequate_verdict,
    make_effect,
    make_oracle,
    make_plain_verdict,
    make_truth,
    make_verdict,
    tabulate_cases,
)

from elastocal_proof.blind.locations import list_locations, tabulate_locations
from elastocal_proof.blind.summary import summarize_by_robot, summarize_figures
from elastocal_proof.report.blind_page import (
    describe_reached_targets,
    format_targets_page,
)


def split_cells(row):
    """Cells of a row of a Markdown table."""
    return [cell.strip() for cell in row.strip("|").split("|")]


def test_each_quantity_has_its_target_its_limit_and_a_column_for_each_robot():
    pairs = [
        make_truth(("payload",), ("joint_tilt", 2), group="pair", robot=robot)
        for robot in ("irb7600", "gen3")
    ]
    both = make_verdict("several", make_effect("payload"), make_effect("joint_tilt", 2))
    best = {"detected": True, "right": True}
    entries = [
        (pairs[0], both, make_oracle(), best),
        (pairs[1], make_plain_verdict("named", "payload"), make_oracle(), best),
        (pairs[1], both, make_oracle()),
    ]
    cases = tabulate_cases(*entries)
    summary = summarize_figures(PLAN, cases, pd.DataFrame(), 1)
    alone = summarize_by_robot(PLAN, cases, 1)
    rows = [
        row for truth, verdict, *_ in entries for row in list_locations(truth, verdict)
    ]
    page = format_targets_page(
        PLAN,
        summary,
        {"The heavy one": alone["irb7600"], "A soft one": alone["gen3"]},
        tabulate_locations(rows),
        "full",
        7,
    )
    assert (
        page.startswith("# ") and "blind_pictures --config blind=full seed=7`" in page
    )
    rows = []
    for line in page.partition("## Where")[0].splitlines():
        if line.startswith("| "):
            rows.append([cell.strip() for cell in line.strip("|").split("|")])
    figures = {row[0]: dict(zip(rows[0], row, strict=True)) for row in rows[1:]}
    # A quantity without a case has no row.
    assert len(figures) == len(rows) - 1 == int((summary.target != "").sum())
    assert figures["both of two effects, at 50 each"] == {
        "quantity": "both of two effects, at 50 each",
        "target": "at least 95 % of the limit",
        "outcome": "missed",
        "robots together": "66.7 % (9.4–99.2 %)",
        "cases": "2 of 3",
        "The heavy one": "100.0 %",
        "A soft one": "50.0 %",
        "limit, on a sample": "100.0 % (15.8–100.0 %), 2 of 2",
        "found over limit, same sample": "50.0 % (0.0–100.0 %)",
    }
    alarms = figures["false alarms, 3 kN"]
    assert alarms["outcome"] == "no case"
    assert alarms["cases"] == "0 of 0"
    assert alarms["limit, on a sample"] == ""


def test_a_confusion_table_says_at_which_joints_effects_are_stated():
    truth = make_truth(("joint_tilt", 2))
    verdicts = [make_verdict("named", make_effect("joint_tilt", 3))]
    verdicts.append(make_adequate_verdict())
    rows = [row for verdict in verdicts for row in list_locations(truth, verdict)]
    entries = [(truth, verdict, make_oracle()) for verdict in verdicts]
    summary = summarize_figures(PLAN, tabulate_cases(*entries), pd.DataFrame(), 1)
    page = format_targets_page(PLAN, summary, {}, tabulate_locations(rows), "full", 7)
    lines = page.partition("## Where")[2].splitlines()
    heads, _, cells = (split_cells(line) for line in lines if line[:1] == "|")
    assert heads == ["true", "2", "3", "several", "not stated"]
    assert cells == ["2", "0", "1", "0", "1"]


def test_the_number_of_reached_targets_names_the_robots():
    fine = summarize_figures(
        PLAN,
        tabulate_cases(
            *[(make_truth(), make_adequate_verdict(), make_oracle(1.0))] * 100
        ),
        pd.DataFrame(),
        1,
    )
    assert describe_reached_targets(fine).endswith(
        "with a target reach it on the robots of the proof."
    )
    tuned = summarize_figures(
        PLAN,
        tabulate_cases(
            (make_truth(robot="kuka"), make_adequate_verdict(), make_oracle(1.0))
        ),
        pd.DataFrame(),
        1,
    )
    assert "which proves nothing" in describe_reached_targets(tuned)
