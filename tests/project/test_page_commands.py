"""Every command that a page shows is run by a test or by CI: one that nobody runs fails here by its page and line."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from study_folder import Study
from typer.testing import CliRunner

from elastocal.command.main import app

ROOT = Path(__file__).resolve().parents[2]
SHELLS = ("sh", "bash", "console")
PROGRAMS = (
    "make",
    "snakemake",
    "elastocal",
    "python",
    "pip",
    "uv",
    "apt-get",
    "mkdir",
    "cp",
    "find",
    "sed",
    "git",
    "pre-commit",
)
# Where a script of CI runs a command, word for word.
SCRIPTS = (".ci/run", "workflow/examples/afternoon.sh")
# How-to pages are run from top to bottom, each in a folder of its own, up to a command of these: they need a diagnosis,
# which the scripts have.
AFTER_A_DIAGNOSIS = ("elastocal certificate", "elastocal correct", "elastocal export", "elastocal diagnose")
# Commands that are run elsewhere with other names of files, or stand for a choice: each with the file and what it has there.
ELSEWHERE = {
    # The names of the files are examples; subcommands and options are compared with the script that CI runs.
    **dict.fromkeys(
        (
            "elastocal import urdf arm.urdf --base base_link --tip tool0 --output robot.yaml",
            "elastocal plan robot.yaml --folder campaigns/cell --poses 25 --force 200 --pull --base-known --measured pose"
            " --target tool0=0,0,0",
            "elastocal check campaigns/cell",
            "elastocal diagnose campaigns/cell",
            "elastocal diagnose campaigns/mine",
            "elastocal correct campaigns/cell path.csv --output targets.csv --format krl",
            "elastocal export campaigns/cell --urdf arm.urdf --output calibrated",
            "elastocal certificate campaigns/cell --tolerance 0.2mm",
        ),
        ("tests/workflow/test_afternoon.py", "def test_options_of_the_readme_are_those_of_the_script"),
    ),
    "elastocal import csv tracker.csv --folder campaigns/cell --target SMR1 --column pose=Point": (
        "docs/how_to/import_measurements.md",
        "elastocal import csv tracker.csv --folder campaigns/imported --target SMR1 --column pose=Point",
    ),
    "elastocal import csv tracker_2.csv --folder campaigns/cell_2 --options campaigns/cell/import.yaml": (
        "docs/how_to/import_measurements.md",
        "elastocal import csv tracker_2.csv --folder campaigns/imported_2 --options campaigns/imported/import.yaml",
    ),
    "mkdir -p campaigns/cell7": (".ci/run", "mkdir -p campaigns/cell7"),
    "snakemake -j2 diagnose --config campaign=PATH": (".ci/run", "snakemake -j2 diagnose --config campaign=campaigns/cell7"),
    "python -m elastocal.io.records | sha256sum --check --quiet": (
        "tests/workflow/test_crate.py",
        ".venv/bin/python -m elastocal.io.records | sha256sum --check --quiet",
    ),
    "snakemake --profile profiles/slurm study": ("tests/workflow/test_slurm.py", '"--profile", str(profile)'),
    **dict.fromkeys(
        ("snakemake store", "snakemake -j2 store --config store=s3://BUCKET/FOLDER"),
        ("tests/workflow/test_store.py", 'STORE = ("store", "--config"'),
    ),
    "snakemake -j2 store --config store=s3://BUCKET/FOLDER "
    "crate_of='[study, loop, measured, league, blind, closed_loop, planning]'": (
        "tests/workflow/test_store.py",
        '"crate_of=[blind]"',
    ),
    "python -m zipfile -e reports/sources.zip .": (
        "tests/workflow/test_store.py",
        '("-m", "zipfile", "-e", "reports/sources.zip", ".")',
    ),
    "python workflow/check_crate.py": ("tests/workflow/test_crate.py", 'REPOSITORY / "workflow" / "check_crate.py"'),
    "snakemake --report report.html": ("tests/workflow/test_snakemake_report.py", '"--report", str(path))'),
    # Minutes of measurement: CI runs them in a small setting.
    **{
        f"python benchmarks/{script}{options}": ("tests/workflow/test_benchmarks.py", f'ended("{script}", ')
        for script, options in (
            ("run.py", ""),
            ("run.py", " --small"),
            ("interval_coverage.py", ""),
            ("cost.py", " few more proof --data-sets 250 750"),
        )
    },
    "pip install -e .": ("Makefile", "--no-deps --no-build-isolation -e ."),
    "pip install pin": ("pyproject.toml", 'audit = ["pin>=3"]'),
    "pip wheel --no-deps .": ("tests/project/test_wheel.py", '[*pip, "wheel", *alone, ".", "-w", "dist"]'),
    "python -m pip wheel --no-deps --no-build-isolation -w dist .": (
        "tests/project/test_wheel.py",
        '[*pip, "wheel", *alone, ".", "-w", "dist"]',
    ),
}
# Not of this project, and with an effect on the machine: of the system's own package manager and of git's hooks.
NOT_OURS = ("docker build", "docker run", "apt-get install", "pre-commit install", "pip show elastocal", "alias elastocal=")


def pages():
    found = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("[bcdr]*/README.md")]
    return sorted(page for page in found if page.name not in ("paper.md", "CHANGELOG.md") and "site" not in page.parts)


def as_typed(line):
    """A line of a shell without its comment, blanks that align it, and the folder of the environment."""
    words = re.sub(r"\s+#.*", "", line.strip())
    return " ".join(words.split()).replace(".venv/bin/", "").replace(r"\|", "|")


def begins_a_command(text):
    words = text.split()
    while words and re.fullmatch(r"\w+=\S*", words[0]):
        words.pop(0)
    return bool(words) and (words[0] in PROGRAMS or words[0].startswith("workflow/")) and len(words) > 1


def shell_lines(text):
    """Lines of a block as the shell takes them: continued ones joined, here-documents left out."""
    without = re.sub(r"<<'(\w+)'\n.*?\n\1$", r"<<'\1'", text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"\\\n\s*", " ", without).splitlines()


def commands(page):
    """Commands of a page with their lines: of blocks, and those within sentences that have more than a name."""
    found = []
    for token in MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8")):
        if token.type in ("fence", "code_block") and token.info.strip() in ("", *SHELLS):
            lines = shell_lines(token.content)
            certain = token.info.strip() in SHELLS
            found += [
                (as_typed(line), token.map[0])
                for line in lines
                if line.strip() and (certain or begins_a_command(as_typed(line)))
            ]
        for child in token.children or ():
            if child.type == "code_inline" and begins_a_command(as_typed(child.content)) and "=…" not in child.content:
                found.append((as_typed(child.content), token.map[0]))
    return [(text, f"{page.relative_to(ROOT)}:{line + 1}") for text, line in found if text and not text.startswith("#")]


def every_command():
    return [entry for page in pages() for entry in commands(page)]


def run_by_a_script(text):
    """Whether a script of CI has the command word for word."""
    return any(text in map(as_typed, shell_lines((ROOT / name).read_text(encoding="utf-8"))) for name in SCRIPTS)


def story(page):
    """What a how-to page types, until something needs a diagnosed campaign; None of another page."""
    if "how_to" not in page.parts:
        return None
    blocks = [
        t.content
        for t in MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8"))
        if t.type == "fence" and t.info == "sh"
    ]
    return [block for block in blocks if not block.startswith(AFTER_A_DIAGNOSIS)]


STORIES = {page.stem: story(page) for page in pages() if story(page)}
TOLD = {as_typed(line) for blocks in STORIES.values() for block in blocks for line in shell_lines(block)}


def way_of(text):
    """How a command is run, or None."""
    if run_by_a_script(text):
        return "script"
    if text in TOLD:
        return "story"
    if text in ELSEWHERE:
        return "elsewhere"
    if text.startswith(NOT_OURS):
        return "not ours"
    if re.fullmatch(r"make [\w./-]+", text):
        return "make"
    # `make test` and `make test-slow` run all of them.
    if (found := re.fullmatch(r"python -m pytest (tests/\S+?)( --slow all)?", text)) and (ROOT / found[1]).exists():
        return "script"
    if text.startswith("snakemake "):
        return "dry run"
    if re.fullmatch(r"elastocal( \w+){0,2}( --help)?", text):
        return "help"
    return None


def test_no_command_of_a_page_is_run_by_nobody():
    nobody = [f"{where}: {text}" for text, where in every_command() if way_of(text) is None]
    assert nobody == [], "neither run here nor by a script; add it to a how-to page, to .ci/run, or to ELSEWHERE"


def test_the_search_finds_commands_of_each_kind(tmp_path):
    """Lest a change of the pages' style empty it."""
    ways = {way_of(text) for text, _ in every_command()}
    assert ways == {"script", "story", "elsewhere", "not ours", "make", "dry run", "help"}
    assert len(every_command()) > 60
    new = tmp_path / "new.md"
    new.write_text(
        "Try `elastocal plan mine.yaml --poses 3`.\n\n    make coffee now\n\n```sh\nrm nothing\n```\n", encoding="utf-8"
    )
    page = ROOT / os.path.relpath(new, ROOT)
    assert [way_of(text) for text, _ in commands(page)] == [None, None, None]


@pytest.mark.parametrize("text", ELSEWHERE)
def test_what_is_run_elsewhere_is_there_and_still_on_a_page(text):
    file, line = ELSEWHERE[text]
    assert line in (ROOT / file).read_text(encoding="utf-8")
    assert text in {found for found, _ in every_command()}


def test_commands_that_are_only_named_have_help():
    """A subcommand that a page names without its arguments is there."""
    for text in sorted({text for text, _ in every_command() if way_of(text) == "help"}):
        words = [word for word in text.split() if word != "--help"][1:]
        result = CliRunner().invoke(app, [*words, "--help"])
        assert result.exit_code == 0, text


def test_make_knows_its_targets():
    targets = sorted({text for text, _ in every_command() if way_of(text) == "make"})
    ran = subprocess.run(["make", "-n", *(text.split()[1] for text in targets)], cwd=ROOT, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr


def dry_runs():
    """Targets that can be asked for at once, and those that need a configuration of their own."""
    plain, own = set(), []
    for text in sorted({text for text, _ in every_command() if way_of(text) == "dry run"}):
        words = [
            word
            for word in shlex.split(text)[1:]
            if word not in ("-n", "-q", "rules", "-k") and not re.fullmatch(r"-j\d+", word)
        ]
        # With options of its own, of which one, `--version`, would end the others' run before it begins.
        if any(word.startswith("--") for word in words):
            own.append(words)
        else:
            plain |= set(words)
    return [sorted(plain), *own]


def test_targets_are_rules():
    """Without a plan, which takes seconds."""
    rules = [path.read_text(encoding="utf-8") for path in (ROOT / "Snakefile", *(ROOT / "workflow" / "rules").glob("*.smk"))]
    known = {rule for text in rules for rule in re.findall(r"^rule (\w+):", text, re.MULTILINE)}
    assert {word for word in dry_runs()[0] if re.fullmatch(r"[a-z_]+", word)} - known == set()


@pytest.mark.slow
@pytest.mark.parametrize("words", dry_runs(), ids=" ".join)
def test_snakemake_knows_its_targets(words, tmp_path):
    """A dry run: what the targets cost is minutes to hours, and others test what their jobs do."""
    ran = Study.of_links(tmp_path).snakemake("-n", "-q", "all", "-j1", *words)
    assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.mark.slow
@pytest.mark.parametrize("page", STORIES)
def test_a_how_to_page_works_from_top_to_bottom(page, tmp_path):
    Study.of_links(tmp_path)
    binaries = Path(sys.executable).parent
    (tmp_path / ".venv").symlink_to(binaries.parent)
    script = "set -euo pipefail\n" + "\n".join(STORIES[page])
    environment = os.environ | {"PATH": f"{binaries}:{os.environ['PATH']}", "OMP_NUM_THREADS": "1"}
    ran = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, env=environment)
    assert ran.returncode == 0, ran.stdout + ran.stderr
