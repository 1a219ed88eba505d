"""Tables that say something else than the files that they come from are found."""

import pandas as pd
import pytest
from made_audits import CONFIGURATION, ROBOT, failed

from elastocal.audit import tables
from elastocal.audit.audited import Audited


@pytest.fixture
def run(tmp_path):
    (tmp_path / "reports/tables").mkdir(parents=True)
    pd.DataFrame({"robot": ["two"], "c1": [0.5], "c2": [0.8]}).to_csv(tmp_path / "reports/tables/table1.csv", index=False)
    return Audited(tmp_path, CONFIGURATION, {"two": ROBOT}, {}, 4)


def test_every_cell_is_followed(run):
    found = tables.table(run, "reports/tables/table1.csv", "table1")
    assert failed(found) == []
    assert found[-1].checked == "2 of 2 cells followed"


def test_a_cell_that_does_not_follow_is_found(run):
    run.robots["two"] = ROBOT | {"compliance_urad_per_Nm": [0.5, 0.80001]}
    assert failed(tables.table(run, "reports/tables/table1.csv", "table1")) == ["column c2"]


def test_a_row_that_is_missing_is_found(run):
    run.robots["other"] = ROBOT
    run.configuration = CONFIGURATION | {"robots": ["two", "other"]}
    assert failed(tables.table(run, "reports/tables/table1.csv", "table1")) == ["rows"]


@pytest.mark.parametrize("name", ["two", "other"])
def test_a_row_that_is_there_twice_or_too_many_is_found(run, name):
    file = run.folder / "reports/tables/table1.csv"
    file.write_text(file.read_text("utf-8") + f"{name},0.5,0.8\n", encoding="utf-8")
    assert failed(tables.table(run, "reports/tables/table1.csv", "table1")) == ["rows"]


@pytest.mark.parametrize(("value", "holds"), [("0.8", True), ("0.7", False), ("0.80 ± 0.01", True), ("0.81 ± 0.01", False)])
@pytest.mark.parametrize("ending", ["md", "tex"])
def test_a_printed_value_is_that_of_the_csv_to_its_digits(run, value, holds, ending):
    lines = {
        "md": ["| robot | c1 | c2 |", "|---|---|---|", f"| two | 0.5 | {value} |"],
        "tex": [r"robot & c1 & c2 \\", "two & 0.5 & " + value.replace("±", r"$\pm$") + r" \\"],
    }[ending]
    (run.folder / f"reports/tables/table1.{ending}").write_text("\n".join(lines), encoding="utf-8")
    found = tables.printed(run, f"reports/tables/table1.{ending}", "table1", ending)
    assert (failed(found) == []) is holds
