"""Bad input ends with one line that names the file, the key and what is allowed, and leaves nothing that looks finished."""

import fcntl
import os
import re
import subprocess
import time
from pathlib import Path

import psutil
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from durations import HUNG_S
from support import refused

from one_run import begin

KUKA = "config/robots/kuka.yaml"
MEASURED = "data/simulated/kuka/200um/measured.parquet"
IDENTIFIED = "results/identified/kuka/200um/6DoF.parquet"


def _unknown_point(study):
    study.replace("config/strategies/3+6DoF-comb.yaml", "[3DoF, 6DoF]", "[3DoF, 7DoF]")


# What stands behind each door: its schema, its YAML, its file, a robot's, a strategy's, one key beside another. What else is
# refused there is in tests/study/test_configuration.py.
FAULTS = {
    "typo in a key": (
        lambda study: study.replace("config.yaml", "data_sets:", "data_set:"),
        ["config.yaml: data_set: ", "allowed: 'data_sets'?"],
    ),
    "configuration that is no YAML": (
        lambda study: study.append("config.yaml", "tables: [\n"),
        ["config.yaml: line ", "allowed: YAML"],
    ),
    "key twice": (
        lambda study: study.append("config.yaml", "seed: 2\n"),
        ["config.yaml: line ", "'seed' again", "allowed: each key once (first in line 1)"],
    ),
    "no configuration": (
        lambda study: study.path("config.yaml").unlink(),
        ["config.yaml: found no such file", "allowed: the path of a readable file"],
    ),
    "chain that does not parse": (
        lambda study: study.replace(KUKA, "Rz(q1)", "Rz q1"),
        [f"{KUKA}: chain: ", "'Rz'", "allowed: Tx(length)"],
    ),
    "strategy with an unknown point": (
        _unknown_point,
        ["config/strategies/3+6DoF-comb.yaml: stages[0].points: ", "'7DoF'", "allowed: 2DoF, 3DoF, 4DoF, 6DoF"],
    ),
    "evaluation beyond the configurations": (
        lambda study: study.configure({"evaluation": {"lengths": [5, 20, 21]}}),
        ["config.yaml: evaluation.lengths[2]: ", "found 21", "allowed: up to configurations = 20"],
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_nothing_starts_and_one_line_says_why(fault, unstarted):
    spoil, said = FAULTS[fault]
    spoil(unstarted)
    ended = unstarted.snakemake("-j1")
    assert ended.returncode != 0
    said_by_snakemake = "Using workflow specific profile"
    lines = [line for line in (ended.stdout + ended.stderr).splitlines() if not line.startswith(said_by_snakemake)]
    assert len(lines) == 1, lines
    source, _, key = said[0].partition(": ")
    # What the schema refuses has the line of the file, too.
    assert re.match(rf"{re.escape(source)}: (line \d+, )?{re.escape(key)}", lines[0])
    assert all(part in lines[0] for part in said[1:])
    assert unstarted.files("data/**/*", "results/**/*", "reports/**/*") == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("-j1", "--config", "evaluation={studies: one}"),
            "config.yaml with --config evaluation: evaluation.studies: found 'one'",
        ),
        (("-j1", "diagnose"), "diagnose: found no campaign; allowed: snakemake -j2 diagnose --config campaign=FOLDER"),
    ],
)
def test_a_faulty_command_ends_with_one_line_that_says_why(arguments, said, unstarted):
    ended = unstarted.snakemake(*arguments)
    assert ended.returncode != 0 and ended.stderr.splitlines()[-1].startswith(said)
    assert "Traceback" not in ended.stderr and unstarted.files("data/**/*", "results/**/*", "reports/**/*") == []


def test_numbers_inside_of_a_mapping_may_come_from_the_command_line(unstarted):
    unstarted.planned("--config", "evaluation={bootstrap_replicates: 20}")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seed: 1\nseed: 2\n", "more.yaml: line 2: found the key 'seed' again; allowed: each key once (first in line 1)"),
        ("a: &a [x, x]\nb: &b [*a, *a]\nseed: !!binary MQ==\n", "more.yaml: line 3: found the tag "),
    ],
)
def test_a_further_configuration_is_read_as_strictly_as_the_first(text, said, unstarted):
    unstarted.path("more.yaml").write_text(text, encoding="utf-8")
    ended = unstarted.snakemake("-j1", "--configfile", "more.yaml")
    assert ended.returncode != 0 and said in ended.stderr.splitlines()[-1]
    assert "Traceback" not in ended.stderr


def _truncate(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _edit_one_value(path):
    """Rewrite the file with all its metadata and row groups, and one deflection 1 nm off."""
    file = pq.ParquetFile(path)
    groups = [file.read_row_group(group) for group in range(file.num_row_groups)]
    metadata = {k: v for k, v in file.metadata.metadata.items() if k != b"ARROW:schema"}
    last = groups[-1]
    values = last.column("dx").to_pylist()
    values[7] += 1e-9
    groups[-1] = last.set_column(last.schema.get_field_index("dx"), last.schema.field("dx"), pa.array(values))
    file.close()
    with pq.ParquetWriter(path, groups[0].schema.with_metadata(None)) as writer:
        for group in groups:
            writer.write_table(group.replace_schema_metadata(None))
        writer.add_key_value_metadata(metadata)


@pytest.mark.parametrize("spoil", [_truncate, _edit_one_value])
def test_spoilt_data_end_the_job_that_reads_them(spoil, finished):
    spoil(finished.path(MEASURED))
    ended = finished.snakemake("-j1", IDENTIFIED)
    assert ended.returncode != 0
    log = finished.path("results/logs/identify/kuka/200um/6DoF.log").read_text(encoding="utf-8").splitlines()
    assert len(log) == 1
    assert log[0].startswith(f"{MEASURED}: ")
    assert "found other contents than were written" in log[0]
    assert "allowed: the file as the pipeline wrote it" in log[0]
    assert ended.stderr.splitlines()[-1] == log[0]
    assert "Traceback" not in ended.stderr
    assert not finished.path(IDENTIFIED).exists()
    assert finished.files("results/identified/**/*.partial") == []


def test_a_file_between_that_was_deleted_is_made_again(finished):
    """Although all that was made from it is there."""
    finished.path(MEASURED).unlink()
    assert ("measure", "kuka", "200") in finished.planned()


def test_an_edited_table_is_no_new_input(finished):
    table = finished.path("reports/tables/table4.csv")
    written = table.read_text(encoding="utf-8")
    table.write_text(written.replace("1", "2", 1), encoding="utf-8")
    ended = finished.snakemake("-j1", "reports/tables/table4.tex")
    assert ended.returncode != 0
    assert ended.stderr.splitlines()[-1].startswith("reports/tables/table4.csv: found other contents than were written")


def test_two_runs_of_the_same_files_are_refused_in_one_line(unstarted):
    (unstarted.path(".snakemake/locks")).mkdir(parents=True)
    unstarted.path(".snakemake/locks/0.output.lock").write_text(f"{MEASURED}\n", encoding="utf-8")
    with open(unstarted.path(".snakemake/runs.lock"), "a") as other:
        fcntl.flock(other, fcntl.LOCK_SH)
        ended = unstarted.snakemake("-j1", MEASURED)
    assert ended.returncode != 0
    last = ended.stderr.splitlines()[-1]
    assert last == "snakemake: found another run at work on the same files; allowed: the same command once that one has ended"


def test_a_killed_job_leaves_no_file_under_the_final_name(finished):
    """Killed after its first block, with no chance to tidy up."""
    finished.append(
        "src/elastocal/study/steps/measure.py",
        "\n_blocks = measured_blocks\n\n\ndef measured_blocks(*arguments):\n    import time\n\n"
        "    for block in _blocks(*arguments):\n        yield block\n        time.sleep(600)\n",
    )
    finished.path(MEASURED).unlink()
    started = subprocess.Popen(
        **finished.command("-j1", MEASURED), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    latest = time.monotonic() + HUNG_S
    while not any(finished.path(name).stat().st_size > 4 for name in finished.files(f"{MEASURED}.*.partial")):
        assert started.poll() is None
        assert time.monotonic() < latest
        time.sleep(0.05)
    for process in [*psutil.Process(started.pid).children(recursive=True), started]:
        process.kill()
    assert started.wait() != 0
    assert not finished.path(MEASURED).exists() and len(finished.files(f"{MEASURED}.*.partial")) == 1
    begin(finished.path(".snakemake"), [str(finished.path("data"))]).close()
    assert finished.files(f"{MEASURED}.*.partial") == []


@pytest.mark.parametrize(
    "name",
    [MEASURED, "results/logs/measure/kuka/200um.log", "results/timings", "reports/tables/none.csv", ".snakemake/runs.lock"],
)
@pytest.mark.parametrize("kind", ["link", "pipe"])
def test_what_stands_in_a_folder_of_the_pipeline_and_is_no_file_is_refused_before_any_job(finished, tmp_path, name, kind):
    place, victim = finished.path(name), tmp_path / "victim"
    if place.exists():
        place.rename(victim)
    place.symlink_to(victim) if kind == "link" else os.mkfifo(place)
    ended = finished.snakemake("-j1", MEASURED)
    assert ended.returncode != 0
    assert (
        ended.stderr.splitlines()[-1] == f"{name}: found a {kind}; allowed: a place for a file: a new name, or that of a file"
    )
    assert place.is_symlink() or place.is_fifo()


def test_at_every_name_of_a_finished_study_a_link_is_refused(finished, tmp_path, monkeypatch):
    """Without Snakemake, which is too slow for each of them; what it writes itself is among them."""
    monkeypatch.chdir(finished.folder)
    folders = ["data", "results", "reports"]
    names = [path for folder in (*folders, ".snakemake") for path in Path(folder).rglob("*") if path.name != "README.md"]
    (tmp_path / "victim").touch()
    for path in names:
        path.rename(tmp_path / "kept")
        path.symlink_to(tmp_path / "victim")
        with refused(path, "", "found a link"):
            begin(Path(".snakemake"), folders)
        path.unlink()
        (tmp_path / "kept").rename(path)
    begin(Path(".snakemake"), folders).close()
    finished.path("results").rename(tmp_path / "another disk")
    finished.path("results").symlink_to(tmp_path / "another disk")
    begin(Path(".snakemake"), folders).close()
    print(f"{len(names)} names, each refused")
    assert len(names) > 300
