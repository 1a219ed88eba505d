"""An edit reruns the jobs that depend on it, and no others."""

import json
import os
import re
import subprocess
import sys

import pytest
from durations import HUNG_S
from study_folder import LEVEL, PAPER, REPOSITORY, ROBOT

from import_closure import closure

SCRIPTS = sorted(
    path.name
    for path in (REPOSITORY / "workflow" / "scripts").glob("*.py")
    if "\nrun(" in path.read_text(encoding="utf-8")
)
RUN_STEP = "run_step.py"
# Modules of the study, most of which hold a step of a rule, by the script that calls
# it.
STEPS = [
    f"{RUN_STEP}:elastocal.study.{path.stem}"
    for path in sorted((REPOSITORY / "src/elastocal/study").glob("[a-z]*.py"))
]
DATA = {"draw_experiments", "simulate", "measure"}
GRID = DATA | {"identify"}
STAGED = "4-6DoF-after-3DoF"


def rules(jobs):
    return {job[0] for job in jobs}


def of_the_grid(jobs):
    return {job for job in jobs if job[0] in GRID}


@pytest.fixture(scope="module")
def every_job(paper):
    return of_the_grid(paper.planned(PAPER, "--forceall"))


def test_what_changes_no_result_reruns_nothing(finished_paper):
    """As after a checkout, of which the times are new and figures still name another
    commit; pages; pins of other tools."""
    study = finished_paper
    study.append("README.md", "\n<!-- a comment -->\n")
    for name in study.files(
        "config.yaml", "config/robots/*.yaml", "config/strategies/*.yaml"
    ):
        study.append(name, "# a comment\n")
    for name in ("test", "cluster", "install"):
        study.path(f"requirements/{name}.lock").write_text(
            "# edited\n", encoding="utf-8"
        )
    for name in study.files(
        "Snakefile",
        "config.yaml",
        "config/**/*.*",
        "workflow/**/*.*",
        "src/**/*.*",
        "README.md",
    ):
        os.utime(study.path(name))
    git = [
        "git",
        "-c",
        "user.name=somebody",
        "-c",
        "user.email=somebody@example.org",
        "-c",
        "commit.gpgsign=false",
    ]
    for arguments in (
        ["init", "-q"],
        ["add", "Snakefile", "src", "workflow"],
        ["commit", "-q", "-m", "a"],
    ):
        subprocess.run([*git, *arguments], cwd=study.folder, check=True)
    assert study.planned(PAPER) == set()


def _another_numpy(study):
    """Of two on the path the first counts."""
    study.path("src/numpy-1.0.dist-info").mkdir()
    study.path("src/numpy-1.0.dist-info/METADATA").write_text(
        "Name: numpy\nVersion: 1.0\n", encoding="utf-8"
    )


def _figures_and_a_script(study):
    """Dated back, as from an archive or a clock that was set back: what counts is what
    the file holds."""
    study.edit("src/elastocal/figures/study.py")
    study.replace(
        "workflow/scripts/typeset_table.py", "\nrun(", "\nEDITED = True\nrun("
    )
    os.utime(study.path("workflow/scripts/typeset_table.py"), (1e9, 1e9))


# A file of this size has a checksum too; Snakemake's own limit is 1 MB, and ours was 100.
LARGE_BYTES = 150_000_000
READS_LARGE_FILE = """
rule read_large_file:
    input: "large.bin"
    output: "made.txt"
    shell: "echo read > {output}"
"""


@pytest.mark.slow
def test_a_large_file_counts_by_its_contents_too(tmp_path):
    (tmp_path / "Snakefile").write_text(READS_LARGE_FILE, encoding="utf-8")
    large_file = tmp_path / "large.bin"
    with open(large_file, "wb") as file:
        file.truncate(LARGE_BYTES)
    profile = REPOSITORY / "profiles" / "default"

    def snakemake(*arguments):
        command = [sys.executable, "-m", "snakemake", "--workflow-profile", profile]
        done = subprocess.run(
            [*command, "-j1", *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=HUNG_S,
        )
        assert done.returncode == 0, done.stderr[-2000:]
        return done.stdout + done.stderr

    snakemake()
    later = (tmp_path / "made.txt").stat().st_mtime + 60
    os.utime(large_file, (later, later))
    assert "Nothing to be done" in snakemake("-n")
    with open(large_file, "r+b") as file:
        file.write(b"edited")
    os.utime(large_file, (later, later))
    assert "read_large_file" in snakemake("-n")


# Jobs of the grid that run again, by their rules and wildcards; further rules that do;
# and rules that do not.
EDITS = {
    "list of pins": (
        lambda study: study.append("requirements/run.lock", "# edited\n"),
        None,
        {"typeset_table"},
        set(),
    ),
    "library": (_another_numpy, None, {"typeset_table"}, set()),
    "points of a strategy": (
        lambda study: study.replace(
            f"config/strategies/{STAGED}.yaml", "points: [3DoF]", "points: [2DoF, 3DoF]"
        ),
        {("identify", ROBOT, LEVEL, STAGED)},
        {"tabulate_strategies", "typeset_table"},
        {"tabulate_initial", "tabulate_compliances", "draw_scheme"},
    ),
    "compliance of a robot": (
        lambda study: study.replace(
            "config/robots/kuka.yaml",
            "compliance_urad_per_Nm: [",
            "compliance_urad_per_Nm: [1",
        ),
        {
            ("simulate", ROBOT, ""),
            ("simulate", ROBOT, "/test"),
            ("measure", ROBOT, LEVEL),
        }
        | {("identify", ROBOT, LEVEL, strategy) for strategy in (STAGED, "6DoF")},
        {"summarize_initial", "tabulate_initial", "tabulate_compliances"},
        set(),
    ),
    "metrics": (
        lambda study: study.edit("src/elastocal/study/metrics.py"),
        {("identify", ROBOT, LEVEL, strategy) for strategy in (STAGED, "6DoF")},
        {"tabulate_strategies"},
        {"draw_scheme", "draw_weights"},
    ),
    "figures, and a script that seems older than its results": (
        _figures_and_a_script,
        set(),
        {
            "draw_noise_impact",
            "draw_stiffness_errors",
            "draw_deviations",
            "typeset_table",
        },
        {"tabulate_strategies", "tabulate_initial", "draw_scheme"},
    ),
}


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_reruns_what_depends_on_it(edit, finished_paper, every_job):
    spoil, grid, rerun, untouched = EDITS[edit]
    spoil(finished_paper)
    planned = finished_paper.planned(PAPER)
    assert of_the_grid(planned) == (every_job if grid is None else grid)
    assert rerun <= rules(planned) and not untouched & rules(planned)


def test_sources_cost_no_job_an_input_and_are_in_every_record(paper):
    """As inputs they took half of the time in which Snakemake plans thousands of
    jobs."""
    inputs = paper.inputs_by_rule(PAPER)
    assert not [file for file in inputs["identify"] if file.startswith("src/")]
    assert len(inputs["identify"]) < 10
    for kind in ("identified", "metrics"):
        path = f"results/records/results/{kind}/{ROBOT}/{LEVEL}um/6DoF.parquet.json"
        record = json.loads(paper.path(path).read_text(encoding="utf-8"))
        sources = {file for file in record["inputs"] if file.endswith(".py")}
        modules = closure(
            paper.path("workflow/scripts") / RUN_STEP,
            paper.path("src"),
            "elastocal.study.evaluation",
        )
        names = {file.relative_to(paper.folder).as_posix() for file in modules}
        names = {name for name in names if name.endswith(".py")}
        assert sources == names | {f"workflow/scripts/{RUN_STEP}"}


def test_what_is_added_runs_no_job_of_what_is_there(finished_paper):
    """A robot, a strategy and a noise level: each a file or an entry."""
    study = finished_paper
    text = study.path(f"config/strategies/{STAGED}.yaml").read_text(encoding="utf-8")
    added = text.replace("after 3DoF", "after 2+3DoF").replace(
        "points: [3DoF]", "points: [2DoF, 3DoF]"
    )
    study.path("config/strategies/4-6DoF-after-2+3DoF.yaml").write_text(
        added, encoding="utf-8"
    )
    study.configure(
        {
            "robots": ["ur10", ROBOT],
            "strategies": ["6DoF", "4-6DoF-after-2+3DoF", STAGED],
            "noise_um": [50, 200],
        }
    )
    planned = of_the_grid(study.planned(PAPER))
    assert rules(planned) == GRID
    new = {"ur10", "4-6DoF-after-2+3DoF", "50"}
    assert [job for job in planned if not new & {*job}] == []
    assert {value for job in planned for value in job} >= new


def test_every_script_is_of_a_rule_and_a_rule_watches_the_sources_of_its_own():
    """`complete_rules` gives them to each rule with a script; that of a named step
    watches the function that it calls."""
    used_scripts = []
    for file in sorted((REPOSITORY / "workflow" / "rules").glob("*.smk")):
        for body in re.split(
            r"^ *rule\b", file.read_text(encoding="utf-8"), flags=re.MULTILINE
        )[1:]:
            scripts = re.findall(r'"\.\./scripts/(\w+\.py)"', body)
            steps = re.findall(r'\bstep=("[\w.]+"|step)', body)
            assert len(scripts) == ("script:" in body) and len(steps) == scripts.count(
                RUN_STEP
            )
            used_scripts += scripts
    assert sorted(set(used_scripts) | {RUN_STEP}) == SCRIPTS


# Imports of a script, or of a step, in a process of its own: files of the sources that
# are loaded then.
_LOADED = """
import ast, importlib, json, sys
from pathlib import Path
root, script, step = Path(sys.argv[1]), *sys.argv[2].split(":")
sys.path.insert(0, str(root / "workflow" / "scripts"))
body = ast.parse((root / "workflow" / "scripts" / script).read_text()).body
imports = [node for node in body if isinstance(node, (ast.Import, ast.ImportFrom))]
exec(compile(ast.Module(imports, []), script, "exec"), {})
exec(f"import {step}" if step else "")
# A catalogue imports the modules of its package when it is first asked.
catalogues = [name for name, module in sys.modules.items() if "list_entries" in vars(module)]
for name in catalogues:
    if name != "elastocal.io.modules":
        package = sys.modules[name.rpartition(".")[0]]
        for module_name in sys.modules["elastocal.io.modules"].list_modules(package):
            importlib.import_module(f"{package.__name__}.{module_name}")
loaded = [getattr(module, "__file__", None) for module in list(sys.modules.values())]
files = [Path(file) for file in loaded if file]
inside = [file.relative_to(root).as_posix() for file in files if file.is_relative_to(root)]
print(json.dumps(sorted(inside)))
"""


# Each twelfth has scripts of every kind: data, questions, the loop, proofs.
@pytest.mark.parametrize(
    "scripts",
    [
        [*SCRIPTS[::12], *STEPS[::8]],
        pytest.param([*SCRIPTS, *STEPS], marks=pytest.mark.slow),
    ],
    ids=["some", "all"],
)
def test_the_import_closure_is_what_a_script_loads(scripts, unstarted):
    for script_and_step in scripts:
        script, _, step = script_and_step.partition(":")
        command = [
            sys.executable,
            "-c",
            _LOADED,
            str(unstarted.folder),
            f"{script}:{step}",
        ]
        environment = unstarted.command()["env"]
        done = subprocess.run(
            command,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
            timeout=HUNG_S,
        )
        files = closure(
            unstarted.path("workflow/scripts") / script,
            unstarted.path("src"),
            *([step] if step else []),
        )
        names = [file.relative_to(unstarted.folder).as_posix() for file in files]
        # What reads tables into frames is loaded when it is called, with what it needs.
        later = {"src/elastocal/io/data_frames.py", "src/elastocal/io/storage.py"}
        # A data file that a module reads beside it counts as the module does.
        for stem, suffix in (("diagnosis/settings", "json"), ("study/schemas", "csv")):
            assert (f"src/elastocal/{stem}.{suffix}" in names) == (
                f"src/elastocal/{stem}.py" in names
            )
        assert sorted({*json.loads(done.stdout)} | (later & {*names})) == [
            name for name in names if name.endswith(".py")
        ], script_and_step
