"""An edit reruns the jobs that depend on it, and no others."""

import json
import os
import re
import subprocess
import sys
from itertools import product

import pytest
from durations import HUNG_S
from snakemake_starts import SHARED
from study_folder import NOISE, REPOSITORY, ROBOTS, STRATEGIES

from import_closure import closure

SCRIPTS = sorted(
    path.name
    for path in (REPOSITORY / "workflow" / "scripts").glob("*.py")
    if path.read_text(encoding="utf-8").splitlines()[-1].startswith("run(")
)
LOOP = {
    rule
    for file in (REPOSITORY / "workflow" / "rules").glob("loop*.smk")
    for rule in re.findall(r"^rule (\w+):", file.read_text(encoding="utf-8"), flags=re.MULTILINE)
}
REPORT = {("state_answers",), ("compile_report",), ("all",)}
PER_DATA_SET = {("tabulate_accuracy",), ("draw_bias_and_accuracy",), ("draw_accuracy",)}
# Of the robot without links, at the noise of the tables.
REPEATED = {
    *(("repeat_studies", measured, "kuka") for measured in ("as_configured", "R5_positions", "R5_three_reflectors")),
    ("tabulate_expectations",),
    ("tabulate_studies",),
    ("draw_studies",),
    ("judge_claims",),
}
ASKED = (
    *("repeat_studies", "compare_point_sets", "climb_ladder", "choose_designs", "index_observability"),
    *("tabulate_budget", "tabulate_ladder", "tabulate_designs", "tabulate_observability"),
    *("vary_assumptions", "tabulate_assumptions", "draw_budget", "draw_ladder", "draw_designs"),
    *("map_arm", "tabulate_places", "draw_arm_map", "judge_in_use", "vary_tubes", "tabulate_tubes"),
    *("compare_few", "compare_kinds", "simulate_designs", "tabulate_simulated_designs"),
    *("tabulate_costs", "draw_costs", "tabulate_studies", "draw_studies"),
)
DATA = ("draw_experiments", "simulate", "measure", "summarize_initial", "draw_weights", "judge_design", "draw_scheme")
COMPARED_STRATEGIES = {
    ("compare_solvers", "kuka"),
    ("tabulate_solvers",),
    ("tabulate_strategies",),
    ("judge_in_use", "kuka"),
    ("tabulate_uses",),
    ("draw_metrics",),
    ("typeset_table", "table4"),
    ("tabulate_extended",),
    ("draw_stiffness_errors", "a"),
    ("draw_deviations", "c"),
    ("compare_with_paper",),
    ("draw_scores",),
}


def jobs(rule, *axes):
    return set(product([rule], *axes))


def identified(robots=ROBOTS, noise=NOISE, strategies=STRATEGIES):
    return jobs("identify", robots, noise, strategies)


def designed(robots=ROBOTS, strategies=STRATEGIES):
    """Holds for all noise levels."""
    return jobs("judge_design", robots, strategies)


@pytest.fixture(scope="module")
def every_job(small_study):
    return small_study.planned("--forceall")


def of_rules(every_job, *rules):
    found = {job for job in every_job if job[0] in rules}
    assert {job[0] for job in found} == set(rules)
    return found


def of_the_loop(every_job):
    """Jobs that no part of the study may rerun."""
    return {job for job in every_job if job[0] in LOOP}


def test_a_finished_study_has_nothing_to_do(small_study):
    assert small_study.planned() == set()


def test_new_times_of_unchanged_sources_rerun_nothing(finished):
    """As after a checkout: what counts is what the files hold."""
    for name in finished.files("Snakefile", "config.yaml", "config/**/*.*", "workflow/**/*.*", "src/**/*.*", "README.md"):
        os.utime(finished.path(name))
    assert finished.planned() == set()


def test_a_comment_in_the_readme_reruns_nothing(finished):
    finished.append("README.md", "\n<!-- a comment -->\n")
    assert finished.planned() == set()


def test_a_comment_in_the_configuration_reruns_nothing(finished):
    for name in finished.files("config.yaml", "config/robots/*.yaml", "config/strategies/*.yaml"):
        finished.append(name, "# a comment\n")
    assert finished.planned() == set()


def test_a_new_commit_of_unchanged_sources_reruns_nothing(finished):
    """Figures name the commit at which they were made, which is no reason to make them anew."""
    git = ["git", "-c", "user.name=somebody", "-c", "user.email=somebody@example.org", "-c", "commit.gpgsign=false"]
    for words in (["init", "-q"], ["add", "Snakefile", "src", "workflow"], ["commit", "-q", "-m", "a"]):
        subprocess.run([*git, *words], cwd=finished.folder, check=True)
    assert finished.planned() == set()


def test_an_edited_list_of_pins_reruns_every_job(finished, every_job):
    finished.append("requirements.lock", "# edited\n")
    assert finished.planned() == every_job


def test_another_library_reruns_every_job(finished, every_job):
    """Of two on the path the first counts."""
    finished.path("src/numpy-1.0.dist-info").mkdir()
    finished.path("src/numpy-1.0.dist-info/METADATA").write_text("Name: numpy\nVersion: 1.0\n", encoding="utf-8")
    assert finished.planned() == every_job


def test_pins_of_tests_clusters_and_crates_rerun_nothing(finished):
    for name in ("test", "cluster", "crate", "install"):
        finished.path(f"requirements-{name}.lock").write_text("# edited\n", encoding="utf-8")
    assert finished.planned() == set()


def test_a_strategy_with_other_stages_reruns_that_strategy(finished):
    """The points that it reads are the same, so the bounds are."""
    finished.replace(
        "config/strategies/4-6DoF-after-3DoF.yaml", "joints: [4, 5, 6], held: [1, 2, 3]", "joints: [1, 2, 3, 4, 5, 6]"
    )
    strategy = ["4-6DoF-after-3DoF"]
    expected = designed(strategies=strategy) | identified(strategies=strategy)
    expected |= REPEATED | jobs("expect", ["kuka"], ["200"], strategy)
    assert finished.planned() == expected | COMPARED_STRATEGIES | PER_DATA_SET | REPORT


def test_a_strategy_with_other_points_reruns_that_strategy_and_the_bounds(finished):
    finished.replace("config/strategies/3+6DoF-comb.yaml", "[3DoF, 6DoF]", "[2DoF, 6DoF]")
    strategy = ["3+6DoF-comb"]
    expected = designed(strategies=strategy) | identified(strategies=strategy) | jobs("bound", ROBOTS)
    expected |= REPEATED | jobs("expect", ["kuka"], ["200"], strategy)
    assert finished.planned() == expected | COMPARED_STRATEGIES | PER_DATA_SET | REPORT


def test_another_noise_level_runs_that_level(finished):
    """Neither replaced levels nor their order touch the level that stays."""
    finished.configure({"noise_um": [200, 50]})
    expected = jobs("measure", ROBOTS, ["50"]) | identified(noise=["50"])
    # Without a level without noise the expectations leave the linearisation out.
    expected |= jobs("expect", ["kuka"], ["200"], STRATEGIES) | {("tabulate_expectations",), ("draw_scores",)}
    # Claims on one strategy go over all levels.
    expected |= jobs("expect", ["kuka"], ["50"], ["6DoF"]) | {("judge_claims",)}
    assert finished.planned() == expected | {("draw_noise_impact",)} | PER_DATA_SET | REPORT


def test_the_compliance_of_a_robot_reruns_that_robot(finished):
    finished.replace("config/robots/kuka_extended.yaml", "[0.54, ", "[0.55, ")
    robot = ["kuka_extended"]
    expected = (
        jobs("simulate", robot, ["", "/test"])
        | jobs("measure", robot, NOISE)
        | identified(robot)
        | jobs("bound", robot)
        | jobs("summarize_initial", robot)
        | jobs("draw_scheme", ["fig3"])
        | {("tabulate_initial",), ("typeset_table", "table2"), ("draw_table2_samples",)}
        | {("tabulate_extended",), ("compare_with_paper",), ("draw_scores",), ("judge_claims",)}
        | jobs("climb_ladder", robot)
        | {("tabulate_ladder",), ("draw_ladder",), ("vary_tubes", "kuka_extended"), ("tabulate_tubes",)}
    )
    assert finished.planned() == expected | PER_DATA_SET | REPORT


def test_more_data_sets_rerun_their_draws_but_not_those_of_the_test(finished, every_job):
    finished.configure({"data_sets": 13})
    untouched = (
        jobs("draw_experiments", ROBOTS, ["/test"])
        | jobs("simulate", ROBOTS, ["/test"])
        | {("tabulate_compliances",), ("typeset_table", "table1")}
        | of_rules(every_job, "draw_scheme")
        | of_the_loop(every_job)
    )
    assert untouched < every_job
    assert finished.planned() == every_job - untouched


def test_an_edit_of_the_bounds_reruns_the_bounds(finished):
    finished.edit("src/elastocal/study/bounds.py")
    asked = jobs("compare_point_sets", ["kuka"]) | {("tabulate_budget",), ("draw_budget",)}
    asked |= {("tabulate_costs",), ("draw_costs",), ("judge_claims",)}
    asked |= jobs("index_observability", ["kuka"]) | {("tabulate_observability",)}
    assert finished.planned() == jobs("bound", ROBOTS) | PER_DATA_SET | asked | REPORT


def test_an_edit_that_is_older_than_the_results_counts_too(finished):
    """As from an archive, a copy that keeps dates, or a clock that was set back."""
    finished.replace("workflow/scripts/draw_scores.py", "run(draw", "EDITED = True\nrun(draw")
    os.utime(finished.path("workflow/scripts/draw_scores.py"), (1e9, 1e9))
    assert finished.planned() == {("draw_scores",), ("compile_report",), ("all",)}


def test_an_edit_of_the_strategy_figures_reruns_figures(finished):
    finished.edit("src/elastocal/figures/strategies.py")
    figures = {
        ("draw_noise_impact",),
        ("draw_stiffness_errors", "a"),
        ("draw_deviations", "c"),
        ("draw_bias_and_accuracy",),
        ("draw_accuracy",),
        ("draw_studies",),
    }
    assert finished.planned() == figures | {("compile_report",), ("all",)}


@pytest.mark.parametrize(
    ("module", "kept"),
    [
        ("gauss_newton", {"bound", "tabulate_compliances", "tabulate_initial", "draw_table2_samples", *ASKED}),
        ("metrics", {"compare_solvers"}),
    ],
)
def test_an_edit_of_solver_or_metrics_leaves_data_and_designs(module, kept, finished, every_job):
    finished.edit(f"src/elastocal/study/{module}.py")
    untouched = of_rules(every_job, *kept, *DATA) | of_the_loop(every_job)
    if module == "gauss_newton":
        untouched |= jobs("typeset_table", ["table1", "table2"])
    assert finished.planned() == every_job - untouched


def test_comments_and_docstrings_rerun_nothing(finished):
    finished.append("src/elastocal/study/metrics.py", "# a comment\n")
    finished.replace("src/elastocal/study/identification.py", '"""Equation 11', '"""Of equation 11')
    finished.replace("workflow/scripts/draw_scores.py", '"""The paper', '"""Of the paper')
    assert finished.planned() == set()
    finished.run()
    assert finished.planned() == set()


def test_every_rule_watches_the_sources_of_its_own_script():
    seen = []
    for file in sorted((REPOSITORY / "workflow" / "rules").glob("*.smk")):
        for body in re.split(r"^rule ", file.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
            scripts = re.findall(r'"\.\./scripts/(\w+\.py)"', body)
            assert re.findall(r'sources\("(\w+\.py)"\)', body) == scripts
            assert len(scripts) == ("script:" in body)
            seen += scripts
    assert sorted(seen) == SCRIPTS


# Forks before it imports anything of the package, so that every script starts without it; other people's modules may be there.
_LOADED = (
    f"import {', '.join(SHARED)}"
    + """
import ast, json, os, sys
from pathlib import Path
root = Path(sys.argv[1])
sys.path.insert(0, str(root / "workflow" / "scripts"))
for script in sys.argv[2:]:
    read, write = os.pipe()
    if not os.fork():
        body = ast.parse((root / "workflow" / "scripts" / script).read_text()).body
        imports = [node for node in body if isinstance(node, (ast.Import, ast.ImportFrom))]
        exec(compile(ast.Module(imports, []), script, "exec"), {})
        # A catalogue looks up the modules beside it when it is asked.
        for name in [name for name in sys.modules if name.startswith("elastocal.") and name.endswith(".catalogue")]:
            package = sys.modules[name.rpartition(".")[0]]
            sys.modules["elastocal.io.modules"].modules_with("__name__", package)
        files = [Path(m.__file__) for m in list(sys.modules.values()) if getattr(m, "__file__", None)]
        own = sorted(f.relative_to(root).as_posix() for f in files if f.is_relative_to(root))
        os.write(write, json.dumps(own).encode())
        os._exit(0)
    os.close(write)
    print(script, os.fdopen(read).read())
    assert os.wait()[1] == 0
"""
)


@pytest.fixture(scope="module")
def loaded(small_study):
    """Modules of the study that the imports of each script load."""
    done = subprocess.run(
        [sys.executable, "-c", _LOADED, str(small_study.folder), *SCRIPTS],
        env=small_study.command()["env"],
        capture_output=True,
        text=True,
        check=True,
        timeout=HUNG_S,
    )
    return {script: json.loads(files) for script, files in (line.split(" ", 1) for line in done.stdout.splitlines())}


@pytest.mark.parametrize("script", SCRIPTS)
def test_the_import_closure_is_what_a_script_loads(script, small_study, loaded):
    scripts = small_study.path("workflow/scripts")
    found = closure(scripts / script, small_study.path("src"))
    assert [file.relative_to(small_study.folder).as_posix() for file in found] == loaded[script]
