"""What a command and a job may import: by the modules that are there afterwards, not by time."""

import json
import subprocess
import sys

import pytest
from study_folder import REPOSITORY

# What takes a tenth of a second and more, and what only some need. `typer` brings nothing of these.
HEAVY = {
    *("numpy", "pandas", "pyarrow", "pyarrow.compute", "scipy.stats", "scipy.optimize", "scipy.spatial", "scipy.linalg"),
    *("statsmodels", "sklearn", "matplotlib", "mujoco", "jsonschema", "yaml", "rich", "snakemake.workflow", "typst", "pooch"),
}
STUDY = {"numpy", "pyarrow"}
# Each kind of job with what it may have of these beyond what is light.
JOBS = {
    **dict.fromkeys(("draw_experiments", "simulate", "measure", "judge_design", "draw_weights"), STUDY),
    **dict.fromkeys(("identify", "bound", "expect", "summarize_initial", "repeat_studies"), STUDY),
    "read_campaign": STUDY | {"jsonschema", "yaml"},
    "import_campaign": STUDY | {"jsonschema", "yaml"},
}
COMMANDS = ("", "demo", "init", "import", "import urdf", "import dh", "import csv", "plan", "check", "diagnose", "correct")
COMMANDS += ("certificate", "export")
# Each in a process of its own, forked from one that has imported nothing yet.
PROGRAM = """
import ast, io, json, os, sys
from contextlib import redirect_stdout, suppress

jobs, commands, heavy = json.loads(sys.argv[1])
sys.path.insert(0, "workflow/scripts")

def imports_of(script):
    tree = ast.parse(open(f"workflow/scripts/{script}.py", encoding="utf-8").read())
    kept = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    exec(compile(ast.Module(kept, []), script, "exec"), {})

def helps(command):
    sys.argv = ["elastocal", *command.split(), "--help"]
    with redirect_stdout(io.StringIO()), suppress(SystemExit):
        from elastocal.command.main import main
        main()

for act, name in [*((imports_of, job) for job in jobs), *((helps, command) for command in commands)]:
    sys.stdout.flush()
    if not (child := os.fork()):
        act(name)
        print(json.dumps([name, [module for module in heavy if module in sys.modules]]), flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""


@pytest.fixture(scope="module")
def imported():
    """Of each job and each command the heavy modules that it has imported."""
    asked = json.dumps([[*JOBS], COMMANDS, sorted(HEAVY)])
    done = subprocess.run([sys.executable, "-c", PROGRAM, asked], cwd=REPOSITORY, capture_output=True, text=True, check=True)
    return {name: set(modules) for name, modules in map(json.loads, done.stdout.splitlines())}


@pytest.mark.parametrize("job", JOBS)
def test_a_job_imports_what_it_needs_and_nothing_heavy_beside_it(imported, job):
    assert imported[job] <= JOBS[job]


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_imports_nothing_heavy(imported, command):
    assert imported[command] == set()
