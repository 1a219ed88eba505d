"""The profile for Slurm lays out the jobs of every target, which needs no Slurm: no group waits for jobs that wait for it."""

import re

from study_folder import Study

# Those of the page, and the others of hours.
TARGETS = ("study", "measured", "league", "blind", "closed_loop", "bad_rows", "planning", "extended_study")


def test_jobs_of_every_target_can_be_grouped(tmp_path):
    done = Study.of_links(tmp_path).snakemake("--profile", "profiles/slurm", "-n", "-p", *TARGETS)
    assert done.returncode == 0, done.stderr[-3000:]
    laid_out = set(re.findall(r"^(\w+) +\d+$", done.stdout, re.MULTILINE))
    assert {"seal_cases", "compile_report", "tabulate_league", "summarize_closed_loop"} <= laid_out
