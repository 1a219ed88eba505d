"""A run described as a crate: rocrate reads it, and finds each job, file and package in it."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import pytest
from rocrate.rocrate import ROCrate

from elastocal.crate.run_crate import FinishedRun, run_crate
from elastocal.crate.software import Package
from elastocal.errors import InputError
from elastocal.io.json_files import write_json
from elastocal.io.origin import Origin
from elastocal.io.records import JobRecord

ORIGIN = Origin("c0ffee", "d16e57", 7)
WORDS = {"name": "a run", "description": "It ran.", "author": "the developers", "licence": "MIT"}
TEXTS = {
    "Snakefile": "rule all: input: 'reports/b.csv'\n",
    "workflow/rules/a.smk": "",
    "workflow/scripts/simulate.py": "",
    "workflow/scripts/tabulate.py": "",
    "src/elastocal/model.py": "",
    "config/robot.yaml": "name: a\n",
    "results/3+6DoF.parquet": "a",
    "reports/b.csv": "b\n",
    "reports/configuration.json": "{}",
    "reports/software.csv": "name\n",
}


def record(rule, hour, inputs, output):
    sources = [f"workflow/scripts/{rule}.py", "src/elastocal/model.py"]
    times = (f"2026-01-01T{hour:02}:00:00+00:00", f"2026-01-01T{hour:02}:30:00+00:00")
    return JobRecord(rule, {"robot": "kuka"}, *times, dict.fromkeys((*inputs, *sources), ""), (), (output,), ORIGIN, {})


@pytest.fixture
def finished(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in TEXTS.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")
    return FinishedRun(
        jobs=[
            record("simulate", 1, ["config/robot.yaml"], "results/3+6DoF.parquet"),
            record("tabulate", 2, ["results/3+6DoF.parquet"], "reports/b.csv"),
        ],
        origin=ORIGIN,
        workflow="Snakefile",
        rules=["workflow/rules/a.smk"],
        configuration="reports/configuration.json",
        software_list="reports/software.csv",
        packages=[Package("numpy", "2.0", "BSD-3-Clause")],
        python="3.11.2",
    )


@pytest.fixture
def crate(finished, tmp_path):
    write_json("ro-crate-metadata.json", run_crate(finished, WORDS))
    return ROCrate(tmp_path)


def test_the_workflow_is_the_main_entity_with_a_step_for_each_rule(crate):
    assert crate.mainEntity.id == "Snakefile"
    assert [step["name"] for step in crate.mainEntity["step"]] == ["simulate", "tabulate"]
    assert crate.mainEntity["version"] == "c0ffee"


def test_each_job_is_an_action_with_script_files_and_times(crate):
    action = crate.dereference("#job-2")
    assert action["name"] == "tabulate kuka" and action["instrument"].id == "workflow/scripts/tabulate.py"
    assert [file.id for file in action["object"]] == ["results/3%2B6DoF.parquet"]
    assert [file.id for file in action["result"]] == ["reports/b.csv"]
    assert action["startTime"] < action["endTime"]
    assert all(word in action["description"] for word in ("c0ffee", "d16e57", "seed 7"))


def test_every_file_has_its_size_and_digest(crate):
    described = {unquote(entity.id): entity for entity in crate.get_entities() if entity.get("sha256")}
    assert set(described) == set(TEXTS)
    for name, text in TEXTS.items():
        assert described[name]["sha256"] == hashlib.sha256(text.encode()).hexdigest()
        assert described[name]["contentSize"] == str(len(text))


def test_a_folder_that_a_job_wrote_is_described_with_each_file_in_it(finished, tmp_path):
    for name in ("data/cases 1/a/robot.yaml", "data/cases 1/b.json", "data/cases 1/.snakemake_timestamp"):
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(name, encoding="utf-8")
    jobs = [record("simulate", 1, [], "data/cases 1"), record("tabulate", 2, ["data/cases 1"], "reports/b.csv")]
    write_json("ro-crate-metadata.json", run_crate(replace(finished, jobs=jobs), WORDS))
    crate = ROCrate(tmp_path)
    folder = crate.dereference("data/cases%201/")
    assert [unquote(file.id) for file in folder["hasPart"]] == ["data/cases 1/a/robot.yaml", "data/cases 1/b.json"]
    assert all(file["sha256"] for file in folder["hasPart"])
    assert crate.dereference("#job-1")["result"] == [folder] == crate.dereference("#job-2")["object"]


@pytest.mark.usefixtures("crate")
def test_every_reference_is_to_something_that_the_crate_has():
    def references(value):
        if isinstance(value, dict):
            yield from [value["@id"]] if set(value) == {"@id"} else ()
        for each in value if isinstance(value, list) else ():
            yield from references(each)

    graph = json.loads(Path("ro-crate-metadata.json").read_text(encoding="utf-8"))["@graph"]
    there = {entity["@id"] for entity in graph}
    missing = {name for entity in graph for value in entity.values() for name in references(value)} - there
    assert {name for name in missing if not name.startswith("https://")} == set()


def test_no_folder_of_the_machine_is_named(crate, tmp_path):
    assert str(tmp_path) not in Path("ro-crate-metadata.json").read_text(encoding="utf-8")


def test_a_file_outside_of_the_folder_is_refused(finished, tmp_path):
    finished.jobs[0] = record("simulate", 1, [str(tmp_path.parent / "robot.yaml")], "results/3+6DoF.parquet")
    with pytest.raises(InputError, match="outside of the folder"):
        run_crate(finished, WORDS)


def test_the_same_run_is_the_same_crate(finished):
    assert json.dumps(run_crate(finished, WORDS)) == json.dumps(run_crate(finished, WORDS))
