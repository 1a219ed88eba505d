"""Results in another folder than the sources, as in a container, and jobs on a cluster:
every target lays out its jobs."""

import re

from snakemake_starts import started

TARGETS = [
    "paper",
    "study",
    "loop",
    "measured",
    "league",
    "blind",
    "closed_loop",
    "audit",
]


def test_every_target_finds_its_sources_and_its_jobs_can_be_grouped(
    unstarted, tmp_path
):
    """The profile for Slurm lays out groups, which needs no Slurm: no group waits for
    jobs that wait for it."""
    folder = tmp_path / "results of mine"
    folder.mkdir()
    where = (
        "--snakefile",
        str(unstarted.path("Snakefile")),
        "--profile",
        str(unstarted.path("profiles/slurm")),
    )
    done = started(
        **unstarted.command("-n", "-p", *where, "--", *TARGETS) | {"cwd": folder}
    )
    assert done.returncode == 0, done.stderr[-3000:]
    laid_out = set(re.findall(r"^(\w+) +\d+$", done.stdout, re.MULTILINE))
    assert {
        "seal_cases",
        "compile_report",
        "tabulate_league",
        "summarize_closed_loop",
    } <= laid_out


def test_the_paper_is_its_tables_and_figures_alone(paper):
    rules = {job[0] for job in paper.planned("paper", "--forceall")}
    assert {
        "typeset_table",
        "tabulate_strategies",
        "draw_noise_impact",
        "draw_deviations",
        "draw_scheme",
    } <= rules
    beyond = {
        "repeat_studies",
        "compare_point_sets",
        "compare_with_studies",
        "diagnose_campaign",
        "simulate_designs",
    }
    assert not rules & beyond
