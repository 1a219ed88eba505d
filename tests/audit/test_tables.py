"""Tables that say something else than the files that they come from are found."""

import numpy as np
import pandas as pd
import pytest
from made_audits import CONFIGURATION, ROBOT, failed, failed_table
from scipy.stats import t as student

from elastocal_proof.audit import tables
from elastocal_proof.audit.audited import Audited


@pytest.fixture
def run(tmp_path):
    (tmp_path / "reports/tables").mkdir(parents=True)
    pd.DataFrame({"robot": ["two"], "c1": [0.5], "c2": [0.8]}).to_csv(tmp_path / "reports/tables/table1.csv", index=False)
    return Audited(tmp_path, CONFIGURATION, {"two": ROBOT}, {}, 4)


def test_every_cell_is_followed(run):
    found = [*tables.tables(run, "reports/tables/table1.csv", "table1")]
    assert failed(found) == []
    assert found[-1].checked == "3 of 3 cells followed"


def test_a_cell_that_does_not_follow_is_found(run):
    run.robots["two"] = ROBOT | {"compliance_urad_per_Nm": [0.5, 0.80001]}
    assert failed(tables.tables(run, "reports/tables/table1.csv", "table1")) == ["column c2"]


def test_a_row_that_is_missing_is_found(run):
    run.robots["other"] = ROBOT
    run.configuration = CONFIGURATION | {"robots": ["two", "other"]}
    assert failed(tables.tables(run, "reports/tables/table1.csv", "table1")) == ["rows"]


@pytest.mark.parametrize("name", ["two", "other"])
def test_a_row_that_is_there_twice_or_too_many_is_found(run, name):
    file = run.folder / "reports/tables/table1.csv"
    file.write_text(file.read_text("utf-8") + f"{name},0.5,0.8\n", encoding="utf-8")
    assert failed(tables.tables(run, "reports/tables/table1.csv", "table1")) == ["rows"]


@pytest.mark.parametrize(
    ("column", "expected"), [("", []), ("rms_um", ["column rms_um"]), ("zero_leak_urad", ["column zero_leak_urad"])]
)
def test_columns_are_formulas_over_the_files_of_robots(run, column, expected):
    (run.folder / "results/geometry").mkdir(parents=True)
    row = {"estimator": "at once", "noise": 3e-6, "leak": 4e-6, "compliance_noise": 7.0, "compliance_leak": 0.0}
    pd.DataFrame([row | {"zero_noise": 1e-6, "zero_leak": 2e-6}]).to_parquet(run.folder / "results/geometry/two.parquet")
    row = {"robot": "two", "estimator": "at once", "rms_um": 5.0, "noise_um": 3.0, "leak_um": 4.0, "zero_noise_urad": 1.0}
    row |= {"zero_leak_urad": 2.0, "compliance_noise_percent": 7.0, "compliance_leak_percent": 0.0}
    changed = {column: 1.001 * row[column]} if column else {}
    assert failed_table(run, tables, "geometry", pd.DataFrame([row | changed])) == expected


@pytest.mark.parametrize(("value", "holds"), [("0.8", True), ("0.7", False), ("0.80 ± 0.01", True), ("0.81 ± 0.01", False)])
@pytest.mark.parametrize("ending", ["md", "tex"])
def test_a_printed_value_is_that_of_the_csv_to_its_digits(run, value, holds, ending):
    lines = {
        "md": ["| robot | c1 | c2 |", "|---|---|---|", f"| two | 0.5 | {value} |"],
        "tex": [r"robot & c1 & c2 \\", "two & 0.5 & " + value.replace("±", r"$\pm$") + r" \\"],
    }[ending]
    (run.folder / f"reports/tables/table1.{ending}").write_text("\n".join(lines), encoding="utf-8")
    found = tables.printed_tables(run, f"reports/tables/table1.{ending}", "1")
    assert (failed(found) == []) is holds


@pytest.mark.parametrize("printed", [0.9, 2.0, 7.0])
def test_a_further_study_is_as_far_out_as_student_says(printed):
    values = np.array([1.0, 2.0, 2.5, 4.0])
    scale = np.sqrt(values.var(ddof=1) * 1.25 + 0.3**2 / 12)
    expected = 2 * student.sf(abs(printed - values.mean()) / scale, 3)
    found = tables.find_p_value(values.mean(), values.std(ddof=1), 4, printed, 0.3)
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("limit", "length"), [(2.0, 3.0), (0.5, 8.0), (9.0, 1.0)])
def test_a_limit_that_is_not_reached_is_continued_as_one_over_the_length(limit, length):
    assert tables.reach(pd.Series([8.0, -4.0, -2.0, 1.0]), limit) == length


PAIR = {"robot": "two", "metric": "dev_um", "strategy": "a", "other": "b", "rms_ratio": 1.25}
PAIR |= {"ratio": 2.0, "ratio_low": 1.6, "ratio_high": 2.5, "rms_ratio_low": 1.0, "rms_ratio_high": 1.5625, "reversed": False}


@pytest.mark.parametrize(
    ("column", "value", "expected"),
    [
        ("ratio", 2.0, []),
        ("ratio_high", 2.49, ["column ratio_high"]),
        ("reversed", True, ["column reversed"]),
        ("ratio", 2.1, ["column ratio"]),
        ("other", "c", ["rows"]),
    ],
)
def test_pairs_follow_from_the_scores(run, column, value, expected):
    scores = [("a", "dev_um", 4.0), ("b", "dev_um", 2.0), ("a", "rms_um", 5.0), ("b", "rms_um", 4.0)]
    rows = [{"robot": "two", "metric": metric, "strategy": name, "value": value} for name, metric, value in scores]
    pd.DataFrame(rows).to_csv(run.folder / "reports/tables/strategy_scores.csv", index=False)
    by_rms = PAIR | {"metric": "rms_um", "ratio": 1.25, "ratio_low": 1.0, "ratio_high": 1.5625}
    assert failed_table(run, tables, "strategy_pairs", pd.DataFrame([PAIR | {column: value}, by_rms])) == expected
