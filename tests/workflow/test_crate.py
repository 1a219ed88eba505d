"""A finished study as a crate: `snakemake crate` describes every file, and an altered one is found."""

import hashlib
import json
import subprocess
import sys
from urllib.parse import unquote

import pandas as pd
import pytest
from rocrate.rocrate import ROCrate
from study_folder import REPOSITORY

from elastocal.io.records import read_record

CRATE = ("crate", "--config", "crate_of=[paper]")
# As the pages have it.
CHECK_ALL = ".venv/bin/python -m elastocal.io.records | sha256sum --check --quiet"


@pytest.fixture(scope="module")
def study(paper, tmp_path_factory):
    study = paper.copied_to(tmp_path_factory.mktemp("crate") / "study")
    study.run(*CRATE)
    return study


def described(study):
    """Digest of each file that the crate describes, by its name."""
    return {unquote(entity.id): entity["sha256"] for entity in ROCrate(study.folder).get_entities() if entity.get("sha256")}


def test_the_crate_describes_every_result_as_it_is_and_nothing_of_the_machine(study):
    digests = described(study)
    made = study.files("data/**/*.parquet", "results/**/*.parquet", "reports/tables/*", "reports/figures/*")
    assert len(made) > 30 and set(made) <= set(digests)
    for name, digest in digests.items():
        assert hashlib.sha256(study.path(name).read_bytes()).hexdigest() == digest, name
    assert str(study.folder) not in study.path("ro-crate-metadata.json").read_text("utf-8")


def test_every_job_of_the_study_is_an_action(study):
    crate = ROCrate(study.folder)
    actions = [entity for entity in crate.get_entities() if entity.type == "CreateAction"]
    names = [name.removeprefix("results/records/")[:-5] for name in study.files("results/records/**/*.json")]
    jobs = {read_record(name, study.folder)[0].name for name in names} - {"write_crate"}
    # One more: the run as a whole.
    assert len(actions) == len(jobs) + 1
    assert all(action["actionStatus"].endswith("CompletedActionStatus") for action in actions)


def test_configuration_software_and_tables_stand_beside_it(study):
    origin = json.loads(study.path("results/records/ro-crate-metadata.json.json").read_text("utf-8"))["origin"]
    digest = hashlib.sha256(study.path("reports/configuration.json").read_bytes()).hexdigest()
    assert digest == origin["configuration_sha256"]
    assert {"snakemake", "numpy", "pyarrow"} <= set(pd.read_csv(study.path("reports/software.csv"))["name"])
    package = json.loads(study.path("reports/datapackage.json").read_text("utf-8"))
    assert {"tables/table1.csv", "tables/table4.csv"} <= {resource["path"] for resource in package["resources"]}


def test_a_crate_of_a_finished_study_is_made_of_nothing_new(study):
    assert study.planned(*CRATE) == set()


def check(folder):
    checked = [sys.executable, REPOSITORY / "workflow" / "check_crate.py", folder]
    return subprocess.run(checked, capture_output=True, text=True)


def check_in_a_shell(folder):
    command = CHECK_ALL.replace(".venv/bin/python", sys.executable)
    return subprocess.run(command, shell=True, cwd=folder, capture_output=True, text=True)


def test_an_altered_and_a_missing_file_are_found(study, tmp_path):
    altered, missing = study.files("results/identified/**/*.parquet")[:2]
    copy = study.copied_to(tmp_path / "copy")
    copy.path(altered).write_bytes(copy.path(altered).read_bytes() + b" ")
    copy.path(missing).unlink()
    assert check(study.folder).returncode == 0
    found = check(copy.folder)
    assert found.returncode == 1
    assert found.stdout.splitlines() == [f"{missing}: missing", f"{altered}: other bytes than the crate describes"]
    assert check_in_a_shell(study.folder).returncode == 0
    found = check_in_a_shell(copy.folder)
    assert found.returncode == 1
    assert set(found.stdout.splitlines()) == {f"{missing}: FAILED open or read", f"{altered}: FAILED"}
