"""Bad input ends with one line that names the file, the key and what is allowed, and
leaves nothing that looks finished."""

import fcntl
import os
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from study_folder import PAPER
from support import refused

from one_run import begin

MEASURED = "data/simulated/kuka/200um/measured.parquet"
IDENTIFIED = "results/identified/kuka/200um/6DoF.parquet"
SECOND_SEED = "seed: 1\nseed: 2\n"


# Of each door one: the schema, a strategy, the command line, a further file. The rest
# is in tests/study/test_configuration.py.
FAULTS = {
    "a key": (
        lambda study: study.replace("config.yaml", "data_sets:", "data_set:"),
        (),
        ["config.yaml: ", "data_set: ", "allowed: 'data_sets'?"],
    ),
    "a strategy": (
        lambda study: study.replace("config/strategies/6DoF.yaml", "[6DoF]", "[7DoF]"),
        (),
        ["config/strategies/6DoF.yaml: stages[0].points: ", "'7DoF'"],
    ),
    "no campaign": (
        lambda _: None,
        ("diagnose",),
        ["diagnose: found no campaign; allowed: snakemake -j2 diagnose --config"],
    ),
    "a further file": (
        lambda study: study.path("more.yaml").write_text(SECOND_SEED, encoding="utf-8"),
        ("--configfile", "more.yaml"),
        [
            "more.yaml: line 2: found the key 'seed' again;"
            " allowed: each key once (first in line 1)"
        ],
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_nothing_starts_and_one_line_says_why(fault, unstarted):
    spoil, arguments, phrases = FAULTS[fault]
    spoil(unstarted)
    ended = unstarted.snakemake("-j1", *arguments)
    assert ended.returncode != 0
    last = ended.stderr.splitlines()[-1]
    assert all(phrase in last for phrase in phrases)
    assert (
        "Traceback" not in ended.stderr
        and unstarted.files("data/**/*", "results/**/*", "reports/**/*") == []
    )


def _edit_one_value(path):
    """One deflection 1 nm off, in a file that is as readable as before."""
    table = pq.ParquetFile(path).read()
    values = table.column("dx").to_pylist()
    values[7] += 1e-9
    pq.write_table(
        table.set_column(
            table.schema.get_field_index("dx"),
            table.schema.field("dx"),
            pa.array(values),
        ),
        path,
    )


def test_spoilt_data_end_the_job_that_reads_them_and_deleted_ones_are_made_again(
    finished_paper,
):
    _edit_one_value(finished_paper.path(MEASURED))
    ended = finished_paper.snakemake("-j1", IDENTIFIED)
    assert ended.returncode != 0
    (line,) = (
        finished_paper.path("results/logs/identify/kuka/200/6DoF.log")
        .read_text(encoding="utf-8")
        .splitlines()
    )
    assert line.startswith(
        f"{MEASURED}: found other contents than were written;"
        " allowed: the file as the pipeline wrote it"
    )
    assert ended.stderr.splitlines()[-1] == line and "Traceback" not in ended.stderr
    assert (ended.stdout + ended.stderr).count(line) == 1
    assert finished_paper.files(IDENTIFIED, "results/identified/**/*.partial") == []
    finished_paper.path(MEASURED).unlink()
    assert ("measure", "kuka", "200") in finished_paper.planned(PAPER)


def test_two_runs_of_the_same_files_are_refused_in_one_line(unstarted):
    (unstarted.path(".snakemake/locks")).mkdir(parents=True)
    unstarted.path(".snakemake/locks/0.output.lock").write_text(
        f"{MEASURED}\n", encoding="utf-8"
    )
    with open(unstarted.path(".snakemake/runs.lock"), "a") as lock:
        fcntl.flock(lock, fcntl.LOCK_SH)
        ended = unstarted.snakemake("-j1", MEASURED)
    assert ended.returncode != 0
    last = ended.stderr.splitlines()[-1]
    assert last == (
        "snakemake: found another run at work on the same files;"
        " allowed: the same command once that one has ended"
    )


def test_at_every_name_of_a_finished_study_a_link_or_pipe_is_refused(
    finished_paper, tmp_path, monkeypatch
):
    """Without Snakemake, which is too slow for each of them; what it writes itself is
    among them."""
    monkeypatch.chdir(finished_paper.folder)
    folders = ["data", "results", "reports"]
    names = [
        path
        for folder in (*folders, ".snakemake")
        for path in Path(folder).rglob("*")
        if path.name != "README.md"
    ]
    (tmp_path / "victim").touch()
    for number, path in enumerate(names):
        path.rename(tmp_path / "kept")
        path.symlink_to(tmp_path / "victim") if number % 2 else os.mkfifo(path)
        with refused(path, "", f"found a {'link' if number % 2 else 'pipe'}"):
            begin(Path(".snakemake"), folders)
        path.unlink()
        (tmp_path / "kept").rename(path)
    begin(Path(".snakemake"), folders).close()
    finished_paper.path("results").rename(tmp_path / "another disk")
    finished_paper.path("results").symlink_to(tmp_path / "another disk")
    begin(Path(".snakemake"), folders).close()
    assert len(names) > 100
