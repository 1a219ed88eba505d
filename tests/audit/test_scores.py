"""Tables and scores hold as they are, and one altered value does not.

`tests/workflow/test_audit.py` alters a value of each kind of file of a finished study.
"""

import pandas as pd
import pytest
from made_audits import altered, failed

from elastocal_proof.audit.scores import (
    check_errors,
    check_table1,
    check_table_for_people,
    check_verdict,
)

CAMPAIGN = "reports/loop/cell"
TABLE = "reports/tables/table1"
COMPLIANCES = "compliance_{}_urad_per_Nm"


@pytest.fixture
def run_with_table1(run):
    """The first table of the robot `two`, as CSV, Markdown and LaTeX."""
    stated = run.robots["two"]["compliance_urad_per_Nm"]
    row = {"robot": "two"}
    for joint, value in enumerate(stated, 1):
        row[COMPLIANCES.format(joint)] = value
    (run.folder / "reports/tables").mkdir(parents=True)
    pd.DataFrame([row]).to_csv(run.folder / f"{TABLE}.csv", index=False)
    cells = [f"{value:.3g}" for value in stated]
    header = " | ".join(row)
    (run.folder / f"{TABLE}.md").write_text(
        f"| {header} |\n|:--|:--|:--|\n| two | {' | '.join(cells)} |\n"
    )
    (run.folder / f"{TABLE}.tex").write_text(
        "\\begin{tabular}{ll}\n"
        + " & ".join(row)
        + " \\\\\n\\midrule\ntwo & "
        + " & ".join(cells)
        + " \\\\\n\\end{tabular}\n"
    )
    return run


def test_compliances_of_table_1_are_those_of_the_robot_file(run_with_table1):
    run = run_with_table1
    assert not failed(check_table1(run, f"{TABLE}.csv"))
    change = (COMPLIANCES.format(2), 0)
    with altered(run.folder, f"{TABLE}.csv", change, lambda value: 1.000001 * value):
        run.table.cache_clear()
        assert failed(check_table1(run, f"{TABLE}.csv")) == ["compliances of two"]


@pytest.mark.parametrize("suffix", ["md", "tex"])
def test_a_table_for_people_has_the_rounded_numbers_of_the_csv_file(
    run_with_table1, suffix
):
    run = run_with_table1
    file = f"{TABLE}.{suffix}"
    assert not failed(check_table_for_people(run, file, "table1"))
    path = run.folder / file
    text = path.read_text()
    digits = [index for index, mark in enumerate(text) if mark.isdigit()]
    last = digits[-1]
    path.write_text(f"{text[:last]}{(int(text[last]) + 3) % 10}{text[last + 1 :]}")
    assert failed(check_table_for_people(run, file, "table1")) == ["rounded values"]


@pytest.fixture
def run_with_errors(run):
    """Residuals of two poses that are measured twice, and one that is held out."""
    residuals = pd.DataFrame(
        {
            "session": 0,
            "pose": [0, 0, 1, 2],
            "load": 0,
            "target": 0,
            "held_out": [False, False, False, True],
            "gross_error": False,
            "before_dx": [2e-4, 0.0, 3e-4, 5e-4],
            "before_dy": 0.0,
            "before_dz": 0.0,
            "after_dx": [2e-5, 0.0, 3e-5, 5e-5],
            "after_dy": 0.0,
            "after_dz": 0.0,
        }
    )
    folder = run.folder / CAMPAIGN
    folder.mkdir(parents=True)
    residuals.to_parquet(folder / "residuals.parquet")
    rows = []
    heldout = {}
    for name, kind, scale in (("before", "declared", 1.0), ("after", "effect", 0.1)):
        row = {"kind": kind}
        for prefix, mean, rms, largest in (
            ("train", 2e-4, 5**0.5 * 1e-4, 3e-4),
            ("heldout", 5e-4, 5e-4, 5e-4),
        ):
            errors = {"mean_m": mean, "rms_m": rms, "max_m": largest}
            for quantity, value in errors.items():
                row[f"{prefix}_{quantity}"] = scale * value
                if prefix == "heldout":
                    heldout.setdefault(name, {})[quantity] = scale * value
        rows.append(row)
    pd.DataFrame(rows).to_csv(folder / "before_after.csv", index=False)
    pd.Series({"heldout": heldout}).to_json(
        folder / "verdict.json", double_precision=15
    )
    return run


def find_failures(run):
    run.table.cache_clear()
    return failed(
        [
            *check_errors(run, f"{CAMPAIGN}/before_after.csv", "cell"),
            *check_verdict(run, f"{CAMPAIGN}/verdict.json", "cell"),
        ]
    )


def test_errors_of_a_campaign_are_those_of_its_averaged_residuals(run_with_errors):
    assert not find_failures(run_with_errors)


@pytest.mark.parametrize(
    ("column", "row", "expected"),
    [
        ("after_dx", 0, ["errors of fitted poses, after"]),
        ("after_dx", 3, 2 * ["errors of held-out poses, after"]),
        ("before_dx", 3, ["errors of held-out poses, before"]),
    ],
)
def test_one_altered_residual_changes_the_errors(
    run_with_errors, column, row, expected
):
    run = run_with_errors
    file = f"{CAMPAIGN}/residuals.parquet"
    with altered(run.folder, file, (column, row), lambda value: value + 1e-6):
        assert find_failures(run) == expected
