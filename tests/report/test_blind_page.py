"""The page of targets has one row for each quantity, with its robots and its power."""

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
from elastocal_proof.blind.summary import (
    summarize_by_robot,
    summarize_figures,
    tabulate_mechanisms,
)
from elastocal_proof.report.blind_page import (
    describe_reached_targets,
    format_targets_page,
)


def split_cells(row):
    """Cells of a row of a Markdown table."""
    return [cell.strip() for cell in row.strip("|").split("|")]


def build_page(*entries, by_robot=None):
    cases = tabulate_cases(*entries)
    rows = [
        row for truth, verdict, *_ in entries for row in list_locations(truth, verdict)
    ]
    confusion = {
        "mechanisms": tabulate_mechanisms(cases),
        "locations": tabulate_locations(rows),
    }
    summary = summarize_figures(PLAN, cases, pd.DataFrame(), 1)
    names = by_robot or {}
    alone = summarize_by_robot(PLAN, cases, 1)
    tables = {name: alone[robot] for name, robot in names.items()}
    return summary, format_targets_page(summary, tables, confusion, "registered", 7)


def read_rows(section):
    """Rows of a Markdown table as dictionaries, by the cells of their first column."""
    lines = [split_cells(line) for line in section.splitlines() if line[:1] == "|"]
    heads, _, *rows = lines
    return {row[0]: dict(zip(heads, row, strict=True)) for row in rows}


def test_each_quantity_has_its_target_its_power_and_a_column_for_each_robot():
    pairs = [
        make_truth(
            ("payload",), ("joint_tilt", 2), group="pair", robot=robot, level=200.0
        )
        for robot in ("rx160", "xarm7")
    ]
    both = make_verdict("several", make_effect("payload"), make_effect("joint_tilt", 2))
    summary, page = build_page(
        (pairs[0], both, make_oracle()),
        (pairs[1], make_plain_verdict("named", "payload"), make_oracle()),
        (pairs[1], both, make_oracle()),
        by_robot={"The heavy one": "rx160", "A soft one": "xarm7"},
    )
    assert page.startswith("# ")
    assert "blind_pictures --config blind=registered seed=7`" in page
    targets, _, others = page.partition("## Quantities without a target")
    figures = read_rows(targets)
    # A quantity without a case has no row.
    assert len(figures) == int((summary.target != "").sum())
    assert figures["both of two effects, at 200 each"] == {
        "quantity": "both of two effects, at 200 each",
        "target": "at least 78 %",
        "outcome": "missed",
        "robots together": "66.7 % (9.4–99.2 %)",
        "cases": "2 of 3",
        "power, risk": "68 %, 27 %",
        "The heavy one": "100.0 %",
        "A soft one": "50.0 %",
    }
    alarms = figures["false alarms with no effect"]
    assert (alarms["outcome"], alarms["cases"]) == ("no case", "0 of 0")
    assert alarms["power, risk"] == "–"
    assert "false alarms, 3 kN" in read_rows(others.partition("## ")[0])


def test_confusion_tables_say_which_mechanisms_and_joints_are_stated():
    truth = make_truth(("joint_tilt", 2))
    verdicts = [
        make_verdict("named", make_effect("joint_tilt", 3)),
        make_adequate_verdict(),
        make_plain_verdict("class", "joint_tilt", alternatives=["payload"]),
        make_plain_verdict("named", "payload"),
    ]
    _, page = build_page(*[(truth, verdict, make_oracle()) for verdict in verdicts])
    mechanisms, _, joints = page.partition("## Mechanisms")[2].partition("## Joints")
    assert read_rows(mechanisms)["joint tilt"] == {
        "true mechanism": "joint tilt",
        "cases": "4",
        "right, alone": "1",
        "right, with alternatives": "1",
        "nothing stated": "1",
        "other statements": "payload 1",
    }
    assert read_rows(joints)["2"] == {
        "true": "2",
        "2": "0",
        "3": "1",
        "several": "0",
        "not stated": "3",
    }


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
        "with a target reach it on robots on which nothing was developed."
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
