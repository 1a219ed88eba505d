"""The profile for Slurm lays out the jobs of every target, which needs no Slurm: no group waits for jobs that wait for it."""

import os
import re
import sys

import pytest
from snakemake_starts import started
from study_folder import REPOSITORY

# Those of the page, and the others of hours.
TARGETS = ("study", "measured", "league", "blind", "closed_loop", "bad_rows", "planning", "extended_study")


@pytest.fixture
def folder(tmp_path):
    for name in ("Snakefile", "config.yaml", "config", "workflow", "profiles", "src", "paper.bib", "CITATION.cff"):
        (tmp_path / name).symlink_to(REPOSITORY / name)
    return tmp_path


def test_jobs_of_every_target_can_be_grouped(folder):
    called = [sys.executable, "-m", "snakemake", "--profile", "profiles/slurm", "-n", "-p", *TARGETS]
    done = started(called, folder, os.environ | {"PYTHONPATH": str(folder / "src")})
    assert done.returncode == 0, done.stderr[-3000:]
    laid_out = set(re.findall(r"^(\w+) +\d+$", done.stdout, re.MULTILINE))
    assert {"seal_cases", "compile_report", "tabulate_league", "summarize_closed_loop"} <= laid_out
