"""An audit holds on a finished study and finds each error that is planted, with the file that has it."""

import shutil
import subprocess

import pandas as pd
import pytest
import yaml
from durations import HUNG_S
from made_proofs import audited_proofs, made_proofs
from planted_errors import BLIND, CAMPAIGN, CAMPAIGNS, PLANTED, PLANTED_IN_PROOFS

from elastocal_proof.audit.audited import Audited
from elastocal_proof.audit.files import OF_EVERY_FILE
from elastocal_proof.audit.whole import CHECKS, audit, checks_of

# Of these few data sets and replicates enough that what is planted in a share of a file is in the sample.
ROWS = 12


def audited(folder):
    configuration = yaml.safe_load((folder / "config.yaml").read_text("utf-8"))
    documents = {
        kind: {name: yaml.safe_load((folder / f"config/{kind}/{name}.yaml").read_text("utf-8")) for name in configuration[kind]}
        for kind in ("robots", "strategies")
    }
    return Audited(folder, configuration, documents["robots"], documents["strategies"], ROWS)


@pytest.fixture(scope="module")
def folder(small_study, tmp_path_factory):
    """A copy of the finished study with a campaign; each test puts back the file that it changed."""
    study = small_study.copied_to(tmp_path_factory.mktemp("audited") / "study")
    study.configure({"loop": {"campaigns": [CAMPAIGN]}})
    study.run(CAMPAIGNS)
    return study.folder


@pytest.fixture(scope="module")
def findings(folder):
    return audit(audited(folder))


def test_a_finished_study_holds_in_every_check(findings):
    assert [finding for finding in findings if not finding.holds] == []
    assert len(findings) > 1500
    recomputed = {finding.by for finding in findings}
    assert {"pinocchio", "MuJoCo", "statsmodels on pinocchio", "pandas and scipy", "the schemas"} <= recomputed


def test_every_table_of_results_is_recomputed(folder, findings):
    """Beside what is asked of every file: its bytes, schema and provenance."""
    recomputed = {finding.file for finding in findings if finding.checked not in OF_EVERY_FILE and finding.by != "counting"}
    there = {p.relative_to(folder).as_posix() for part in ("data", "results") for p in (folder / part).rglob("*.parquet")}
    # Angles between the sensitivities of all effects of the catalogue are not.
    assert there - recomputed == {f"results/loop/{CAMPAIGN}/confounding.parquet"}


def test_the_page_says_what_each_recomputed_file_holds(findings):
    recomputed = {finding.file for finding in findings if finding.checked not in OF_EVERY_FILE}
    assert all(checks_of(file) for file in recomputed)
    assert all(check.__doc__ for _, check in CHECKS)


# Ends of bootstrap intervals, what lies behind figures of further studies, and words; of a table of two sets of points nothing.
NOT_FOLLOWED = {
    "comparison": {"interpretation", "studies_mean", "studies_std"},
    "expectations": {"studies", "paper", "studies_mean", "studies_std"},
    "strategy_scores": {"value_std_error", "ratio_low", "ratio_high"},
    "strategy_pairs": {"ratio_low", "rms_ratio_low"},
    "joint_test": {f"{name}_studies_{what}" for name in ("below", "statistic") for what in ("median", "largest")},
    "claims": {"place", "claim", "literal", "ours"},
}


def test_every_column_of_the_tables_is_followed_but_those_that_are_named(findings):
    rest = {finding.file: finding.checked.partition("; not ")[2] for finding in findings if "cells followed" in finding.checked}
    assert len(rest) > 15
    found = {file: {*words.split(", ")} for file, words in rest.items() if words}
    assert found == {f"reports/tables/{name}.csv": columns for name, columns in NOT_FOLLOWED.items()}


def found_in(folder, file, plant, run_of):
    """Files with findings once an error is planted; the file is put back."""
    changed = [folder / file, folder / f"results/records/{file}.json"]
    before = [path.read_bytes() for path in changed]
    plant(folder)
    found = audit(run_of(folder), {file})
    for path, content in zip(changed, before, strict=True):
        path.write_bytes(content)
    return [finding.file for finding in found if not finding.holds]


@pytest.mark.parametrize("error", PLANTED)
def test_a_planted_error_is_found(error, folder):
    assert found_in(folder, *PLANTED[error], audited), error


@pytest.fixture(scope="module")
def proofs(tmp_path_factory):
    """A folder with small tables of the blind proof, the closed loop, plans and the league."""
    folder = tmp_path_factory.mktemp("proofs")
    made_proofs(folder)
    return folder


def test_tables_of_the_proofs_hold_in_every_check(proofs):
    found = audit(audited_proofs(proofs))
    assert [finding for finding in found if not finding.holds] == []
    recomputed = {finding.file for finding in found if finding.checked not in OF_EVERY_FILE}
    assert recomputed >= {*BLIND.values()}


@pytest.mark.parametrize("error", PLANTED_IN_PROOFS)
def test_an_error_planted_into_a_proof_is_found(error, proofs):
    assert found_in(proofs, *PLANTED_IN_PROOFS[error], audited_proofs), error


def test_a_ground_truth_altered_after_its_seal_is_found(proofs):
    path = proofs / "data/sealed/some_1/case_003.json"
    before = path.read_bytes()
    path.write_bytes(before.replace(b"1.0", b"1.1"))
    found = audit(audited_proofs(proofs), {"reports/blind/manifest.sha256"})
    path.write_bytes(before)
    assert "case_003.json" in next(finding.note for finding in found if not finding.holds)


def test_eighty_five_errors_at_least_are_planted():
    assert len(PLANTED) + len(PLANTED_IN_PROOFS) >= 85


def test_an_edited_robot_makes_its_files_stale(folder):
    run = audited(folder)
    run.robots["kuka"]["compliance_urad_per_Nm"][0] *= 1.1
    wrong = [finding for finding in audit(run, {"results/metrics/kuka/200um/6DoF.parquet"}) if not finding.holds]
    assert any(finding.checked == "made by what is configured" for finding in wrong)


def test_the_command_says_which_file_is_wrong(finished):
    # Tables are followed cell by cell, whatever the sample of other files.
    finished.configure({"audit": {"rows": 2}})
    assert finished.snakemake("-j2", "audit").returncode == 0
    assert finished.path("reports/audit.txt").read_text("utf-8").endswith("all hold\n")
    PLANTED["a cell of Table 4 altered"][1](finished.folder)
    # As of the time of the job that made it, so that no job is run again.
    shutil.copystat(finished.path("reports/tables/table3.csv"), finished.path("reports/tables/table4.csv"))
    finished.path("reports/audit.csv").unlink()
    done = finished.snakemake("-j2", "audit")
    assert done.returncode != 0
    assert "do not hold, see reports/audit.html" in done.stdout + done.stderr
    table = pd.read_csv(finished.path("reports/audit.csv"))
    wrong = table[~table["holds"]]
    # Its checksum too is that of what is there; the comparison with the paper no longer follows from it.
    ours = {f"reports/tables/{name}" for name in ("table4.csv", "table4.md", "table4.tex", "comparison.csv")}
    assert "reports/tables/table4.csv" in set(wrong["file"]) <= ours
    assert not finished.path("reports/audit.txt").exists()
    assert "do not hold" in finished.path("reports/audit.html").read_text("utf-8")


def test_without_pinocchio_an_audit_ends_in_a_line_before_any_job(unstarted):
    """It comes with an extra; Python imports `sitecustomize` before all else, which hides it here."""
    unstarted.path("src/sitecustomize.py").write_text("import sys\n\nsys.modules['pinocchio'] = None\n", encoding="utf-8")
    command = unstarted.command("-j1", "--quiet", "all", "--", "audit")
    done = subprocess.run(**command, capture_output=True, text=True, timeout=HUNG_S)
    line = "audit: pinocchio: found no such package; allowed: the extra audit: make audit, or pip install pin"
    assert (done.returncode, done.stderr.strip().splitlines()[-1:]) == (1, [line]), done.stderr
    assert "Traceback" not in done.stderr and unstarted.files("data/**/*.parquet", "results/**/*.parquet") == []
