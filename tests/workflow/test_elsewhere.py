"""Results in another folder than the sources, as in a container: `snakemake --snakefile ELSEWHERE/Snakefile`."""

from snakemake_starts import started

TARGETS = (
    "study",
    "paper",
    "extended_study",
    "loop",
    "measured",
    "blind",
    "closed_loop",
    "bad_rows",
    "planning",
    "audit",
    "crate",
)


def test_every_target_finds_its_sources_and_its_configuration(unstarted, tmp_path):
    place = tmp_path / "results of mine"
    place.mkdir()
    command = unstarted.command("-n", "--quiet", "--snakefile", str(unstarted.path("Snakefile")), "--", *TARGETS)
    done = started(**command | {"cwd": place})
    assert done.returncode == 0, done.stderr[-3000:]


def test_the_paper_is_its_tables_and_figures_alone(unstarted):
    rules = {job[0] for job in unstarted.planned("paper")}
    assert {"typeset_table", "tabulate_strategies", "draw_noise_impact", "draw_deviations", "draw_scheme"} <= rules
    beyond = {"repeat_studies", "compare_point_sets", "judge_claims", "compile_report", "diagnose_campaign", "simulate_designs"}
    assert not rules & beyond
