"""An audit holds on a finished study and finds an error of each kind that is planted
into it."""

import shutil
import subprocess

import pandas as pd
import pytest
import yaml
from durations import HUNG_S
from made_audits import altered, failed, forge

from elastocal_proof.audit.audit_run import audit_run
from elastocal_proof.audit.finished_run import FinishedRun

pytestmark = pytest.mark.slow

CAMPAIGN = "kuka_extended_end_effector"
EVIDENCE = f"results/evidence/{CAMPAIGN}.json"
VERDICT = f"reports/loop/{CAMPAIGN}/verdict.json"
MEASURED = "data/simulated/kuka/200um/measured.parquet"
IDENTIFIED, OF_STRATEGY = (
    f"results/identified/kuka/200um/{name}.parquet" for name in ("6DoF", "3+6DoF-comb")
)


def audited(folder):
    configuration = yaml.safe_load((folder / "config.yaml").read_text("utf-8"))
    documents = {"robots": {}, "strategies": {}}
    for kind, by_name in documents.items():
        for name in configuration[kind]:
            path = folder / f"config/{kind}/{name}.yaml"
            by_name[name] = yaml.safe_load(path.read_text("utf-8"))
    # With so few data sets, a sample of 12 rows has an error that is planted in a whole
    # column.
    return FinishedRun(folder, configuration, *documents.values(), 12)


@pytest.fixture(scope="module")
def folder(small_study, tmp_path_factory):
    """A copy of the finished study with a campaign, and what the audit makes again of
    both; each test puts back the file that it changed."""
    study = small_study.copied_to(tmp_path_factory.mktemp("audited") / "study")
    study.configure({"loop": {"campaigns": [CAMPAIGN]}})
    study.run("reports/loop/campaigns.csv", f"reports/loop/{CAMPAIGN}/report.pdf")
    study.run("results/remade.json", EVIDENCE)
    return study.folder


def test_a_finished_study_holds_in_every_check(folder):
    checks = audit_run(audited(folder))
    assert [finding for finding in checks if not finding.holds] == []
    by = {
        "numpy's Philox stream",
        "pinocchio",
        "numpy on pinocchio",
        "statsmodels on pinocchio",
        "MuJoCo",
        "normal density with its covariance in full",
        "the same job, run again",
    }
    assert by <= {finding.by for finding in checks}


@pytest.mark.parametrize(
    ("file", "column", "factor"),
    [
        ("data/simulated/kuka/experiments.parquet", "q3", 57.3),
        ("data/simulated/kuka_extended/ideal.parquet", "dz", -1),
        (f"data/campaigns/{CAMPAIGN}/measurements.parquet", "x", 1.00001),
        (MEASURED, "dx", 1.01),
        (IDENTIFIED, "compliance_2", 1.0001),
        (f"results/loop/{CAMPAIGN}/held_out.parquet", "z", 1.00001),
        (f"results/loop/{CAMPAIGN}/steps.parquet", "std_error", 0.5),
        (f"reports/loop/{CAMPAIGN}/residuals.parquet", "after_dx", 0.99),
    ],
)
def test_a_column_multiplied_is_found_although_its_checksum_is_forged(
    folder, file, column, factor
):
    audited_files = {file, file.replace("held_out", "training")}
    with altered(folder, file, (column, slice(None)), lambda values: factor * values):
        assert [
            finding.file
            for finding in audit_run(audited(folder), audited_files)
            if not finding.holds
        ]


ONE_VALUE = [
    ("results/weights/kuka.parquet", "count"),
    ("results/initial/kuka.parquet", "maximum"),
    ("results/metrics/kuka/200um/6DoF.parquet", "delta_k_3"),
    ("results/replicates/kuka/200um/6DoF.parquet", "k_sigma"),
    ("reports/tables/table1.csv", "compliance_2_urad_per_Nm"),
    ("reports/tables/table2.csv", "max_mm"),
    ("reports/tables/table3.csv", "compliance_5_urad_per_Nm_std_error"),
    ("reports/tables/table4.csv", "k_sigma_20_percent"),
    (f"reports/loop/{CAMPAIGN}/before_after.csv", "train_max_m"),
    (f"reports/loop/{CAMPAIGN}/residuals.parquet", "after_dz"),
]


@pytest.mark.parametrize(("file", "column"), ONE_VALUE)
def test_one_altered_value_is_found_although_its_checksum_is_forged(
    folder, file, column
):
    """Residuals are found by the errors that they add up to."""
    audited_files = {file, file.replace("residuals.parquet", "before_after.csv")}
    row = -1 if file.endswith(".csv") else 3
    with altered(folder, file, (column, row), lambda value: 2 * value + 1):
        assert [
            finding.file
            for finding in audit_run(audited(folder), audited_files)
            if not finding.holds
        ]


@pytest.mark.parametrize(
    ("file", "address"),
    [
        ("reports/answers.json", ["needed", 0, 2]),
        (VERDICT, ["heldout", "noise_floor_rms_m"]),
        ("reports/tables/budget.csv", ("rms_um", 0)),
        ("reports/tables/comparison.csv", ("ours", 1)),
        ("results/ladder/kuka_extended.parquet", ("mean_square", 0)),
    ],
)
def test_one_value_that_only_its_job_makes_again_is_found(folder, file, address):
    def change(value):
        return f"{value}1" if isinstance(value, str) else 1.01 * value

    with altered(folder, file, address, change):
        assert failed(audit_run(audited(folder), {file})) == ["bytes as made again"]


def test_an_altered_probability_of_a_verdict_is_found(folder):
    address = ["probabilities", "mechanisms", "link_elasticity"]
    with altered(folder, VERDICT, address, lambda value: 0.99 * value):
        failures = failed(audit_run(audited(folder), {VERDICT, EVIDENCE}))
    assert set(failures) == {"probability of mechanisms", "bytes as made again"}


@pytest.mark.parametrize(
    "file",
    [
        "reports/figures/figure4.png",
        "reports/figures/figure5a.pdf",
        f"reports/loop/{CAMPAIGN}/figures/arrows.pdf",
        f"reports/loop/{CAMPAIGN}/report.html",
        "reports/study.pdf",
    ],
)
def test_one_altered_byte_of_a_figure_or_report_is_found(folder, file):
    path = folder / file
    before = path.read_bytes()
    record = folder / f"results/records/{file}.json"
    recorded = record.read_bytes()
    middle = len(before) // 2
    changed = bytes([before[middle] ^ 1])
    path.write_bytes(before[:middle] + changed + before[middle + 1 :])
    forge(folder, file)
    try:
        failures = failed(audit_run(audited(folder), {file}))
    finally:
        path.write_bytes(before)
        record.write_bytes(recorded)
    assert failures == ["bytes as made again"]


def test_a_digit_of_a_table_for_people_is_found(folder):
    file = "reports/tables/table1.md"
    path = folder / file
    before = path.read_text("utf-8")
    last = [line for line in before.splitlines() if line.startswith("|")][-1]
    digit = max(index for index, mark in enumerate(last) if mark.isdigit())
    changed = f"{last[:digit]}{(int(last[digit]) + 3) % 10}{last[digit + 1 :]}"
    path.write_text(before.replace(last, changed), "utf-8")
    try:
        findings = audit_run(audited(folder), {file})
    finally:
        path.write_text(before, "utf-8")
    assert "rounded values" in failed(findings)


def test_an_edited_robot_makes_its_files_stale(folder):
    run = audited(folder)
    run.robots["kuka"]["compliance_urad_per_Nm"][0] *= 1.1
    wrong = [
        finding
        for finding in audit_run(run, {"results/metrics/kuka/200um/6DoF.parquet"})
        if not finding.holds
    ]
    assert any(finding.checked == "made by what is configured" for finding in wrong)


def test_the_command_says_which_file_is_wrong(finished):
    finished.configure({"audit": {"rows": 2}})
    done = finished.snakemake("-j2", "audit")
    assert done.returncode == 0, done.stderr[-3000:]
    assert finished.path("reports/audit.txt").read_text("utf-8").endswith("all hold\n")
    with altered(
        finished.folder,
        IDENTIFIED,
        ("compliance_2", slice(None)),
        lambda values: 1.001 * values,
    ):
        # As of the time of the job that made it, so that no job is run again.
        shutil.copystat(finished.path(OF_STRATEGY), finished.path(IDENTIFIED))
        finished.path("reports/audit.csv").unlink()
        done = finished.snakemake("-j2", "audit")
    assert done.returncode != 0
    assert "do not hold, see reports/audit.html" in done.stdout + done.stderr
    table = pd.read_csv(finished.path("reports/audit.csv"))
    # What is computed from the altered file does not hold either.
    scores = {
        IDENTIFIED.replace("identified", kind) for kind in ("metrics", "replicates")
    }
    assert set(table["file"][~table["holds"]]) == {IDENTIFIED} | scores
    assert not finished.path("reports/audit.txt").exists()
    assert "do not hold" in finished.path("reports/audit.html").read_text("utf-8")


def test_without_pinocchio_an_audit_ends_in_a_line_before_any_job(unstarted):
    """It comes with an extra; Python imports `sitecustomize` before all else, which
    hides it here."""
    unstarted.path("src/sitecustomize.py").write_text(
        "import sys\n\nsys.modules['pinocchio'] = None\n", encoding="utf-8"
    )
    command = unstarted.command("-j1", "--quiet", "all", "--", "audit")
    done = subprocess.run(**command, capture_output=True, text=True, timeout=HUNG_S)
    line = (
        "audit: pinocchio: found no such package;"
        " allowed: the extra audit: make audit, or pip install pin"
    )
    assert (done.returncode, done.stderr.strip().splitlines()[-1:]) == (1, [line]), (
        done.stderr
    )
    assert (
        "Traceback" not in done.stderr
        and unstarted.files("data/**/*.parquet", "results/**/*.parquet") == []
    )
