"""The whole audit of a folder: what is asked of every file, and the page."""

import pytest
from made_audits import CONFIGURATION, ROBOT, failed, forge

from elastocal.io.origin import describe_provenance as written_by
from elastocal.io.records import list_recorded_files
from elastocal.io.storage import write_table
from elastocal.study.schemas import INITIAL
from elastocal_proof.audit.audit_run import (
    CHECKS,
    audit_run,
    check_checksum,
    check_provenance,
    render_page,
    tabulate_findings,
)
from elastocal_proof.audit.finished_run import Finding, FinishedRun

# No check computes a file of this name again.
FILE = "results/made/two.parquet"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "results/made").mkdir(parents=True)
    return FinishedRun(tmp_path, CONFIGURATION, {"two": ROBOT}, {}, 4)


def write(folder, seed=1, robot="two"):
    block = {
        "data_set": [0],
        "configurations": [5],
        "mean": [1e-3],
        "mean_square": [1e-6],
        "maximum": [1e-3],
    }
    write_table(
        folder.folder / FILE, INITIAL, [block], written_by({"seed": seed}, robot=robot)
    )
    forge(folder.folder, FILE)


@pytest.mark.parametrize(
    ("wrench_at", "holds"), [("measuring_point", True), ("end_effector", False)]
)
def test_a_study_of_another_interpretation_has_its_settings(folder, wrench_at, holds):
    file = "results/alternatives/R6/initial/two.parquet"
    (folder.folder / file).parent.mkdir(parents=True)
    block = {name: [1e-3] for name in ("mean", "mean_square", "maximum")}
    block |= {"data_set": [0], "configurations": [5]}
    configuration = {"seed": 1, "wrench_at": wrench_at}
    origin = written_by(configuration, robot="two")
    write_table(folder.folder / file, INITIAL, [block], origin)
    forge(folder.folder, file)
    expected = [] if holds else ["made by what is configured"]
    assert failed(audit_run(folder)) == expected


def test_an_unaltered_file_holds(folder):
    write(folder)
    findings = audit_run(folder)
    assert failed(findings) == []
    assert len(findings) == 5
    assert {finding.file for finding in findings} == {FILE}


@pytest.mark.parametrize(
    ("change", "checked"),
    [
        ({"seed": 2}, "made by what is configured"),
        ({"robot": "other"}, "made for where it lies"),
    ],
)
def test_a_file_of_another_run_or_robot_does_not_hold(folder, change, checked):
    write(folder, **change)
    assert failed(check_provenance(folder, FILE)) == [checked]


def test_altered_missing_and_unreadable_files_and_empty_folders_are_findings(
    folder,
):
    assert [finding.holds for finding in audit_run(folder)] == [False]
    write(folder)
    digest = list_recorded_files(folder.folder)[FILE]
    with open(folder.folder / FILE, "ab") as file:
        file.write(b"x")
    assert not check_checksum(folder, FILE, digest).holds
    (folder.folder / FILE).unlink()
    assert check_checksum(folder, FILE, digest).note == "it is missing"
    # A file that cannot be read gives a finding and no traceback.
    (folder.folder / FILE).write_bytes(b"no table")
    forge(folder.folder, FILE)
    findings = audit_run(folder)
    assert [finding.holds for finding in findings] == [True, False]
    assert "ArrowInvalid" in findings[1].note


GOOD = Finding(
    "compliances",
    "numpy on pinocchio",
    4,
    1e-5,
    file="results/identified/kuka/200um/6DoF.parquet",
)
BAD = Finding(
    "column <dev>",
    "pinocchio",
    2,
    7.0,
    "found 1, expected 2",
    "data/simulated/kuka/ideal.parquet",
)
BYTES = Finding(
    "bytes as its job wrote them",
    "hashlib, SHA-256",
    1,
    0.0,
    file="reports/figures/figure3.pdf",
)


def test_the_page_states_whether_all_checks_hold_and_which_files_were_not_recomputed():
    again, apart = render_page(tabulate_findings([GOOD, BYTES]), {"seed": "1"}).split(
        "Files that were neither recomputed nor made again"
    )
    assert "All 2 checks hold." in again and "Failed checks" not in again
    assert (
        "results/identified/*/*um/*.parquet" in again
        and "values of <strong>1 files</strong>" in again
    )
    assert "reports/figures/*.pdf" in apart and "reports/figures/*.pdf" not in again
    assert all(check.__doc__ for _, check in CHECKS)
    # Failed checks are shown, with their text escaped.
    text = render_page(tabulate_findings([GOOD, BAD]), {})
    assert (
        "1 of 2 checks do not hold." in text
        and "column &lt;dev&gt;" in text
        and "http" not in text
    )
    assert "Files that were neither recomputed nor made again" not in text
