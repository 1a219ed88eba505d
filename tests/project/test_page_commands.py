"""Commands on pages have existing targets, subcommands and options.

How-to pages work from top to bottom.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from study_folder import Study
from typer.main import get_command

from elastocal.command.main import app

ROOT = Path(__file__).resolve().parents[2]
SHELLS = ("sh", "bash", "console")
PROGRAMS = ["make", "snakemake", "elastocal", "python", "pip", "uv", "apt-get"]
PROGRAMS += ["mkdir", "cp", "find", "sed", "git", "pre-commit"]
# How-to pages are run from top to bottom, each in its own folder, without these commands:
# they need a diagnosis.
AFTER_A_DIAGNOSIS = (
    "elastocal certificate",
    "elastocal correct",
    "elastocal export",
    "elastocal diagnose",
    "elastocal verify",
)


def pages():
    files = [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
        *ROOT.glob("[bcdr]*/README.md"),
    ]
    return sorted(
        page
        for page in files
        if page.name not in ("paper.md", "CHANGELOG.md") and "site" not in page.parts
    )


def as_typed(line):
    """Remove comment, alignment and the folder of the environment from a line."""
    command = re.sub(r"\s+#.*", "", line.strip())
    return " ".join(command.split()).replace(".venv/bin/", "").replace(r"\|", "|")


def begins_a_command(text):
    arguments = text.split()
    while arguments and re.fullmatch(r"\w+=\S*", arguments[0]):
        arguments.pop(0)
    return (
        bool(arguments)
        and (arguments[0] in PROGRAMS or arguments[0].startswith("workflow/"))
        and len(arguments) > 1
    )


def shell_lines(text):
    """Join continued lines of a block, and leave out here-documents."""
    without = re.sub(
        r"<<'(\w+)'\n.*?\n\1$", r"<<'\1'", text, flags=re.DOTALL | re.MULTILINE
    )
    return re.sub(r"\\\n\s*", " ", without).splitlines()


def commands_of_block(token):
    """List the commands of a code block; a block without a language may be output."""
    language = token.info.strip()
    if token.type not in ("fence", "code_block") or language not in ("", *SHELLS):
        return []
    lines = [as_typed(line) for line in shell_lines(token.content)]
    return [line for line in lines if language in SHELLS or begins_a_command(line)]


def commands_in_sentences(token):
    """List the commands within sentences that have more than a name."""
    codes = [child for child in token.children or () if child.type == "code_inline"]
    lines = [as_typed(code.content) for code in codes]
    return [line for line in lines if begins_a_command(line) and "=…" not in line]


def commands(page):
    """List the commands of a page with their lines."""
    listed = []
    for token in MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8")):
        for line in commands_of_block(token) + commands_in_sentences(token):
            if line and not line.startswith("#"):
                listed.append((line, f"{page.relative_to(ROOT)}:{token.map[0] + 1}"))
    return listed


def every_command():
    return [entry for page in pages() for entry in commands(page)]


def story(page):
    """List the blocks of a how-to page that need no diagnosis; None for other pages."""
    if "how_to" not in page.parts:
        return None
    tokens = MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8"))
    blocks = [
        token.content
        for token in tokens
        if token.type == "fence" and token.info == "sh"
    ]
    return [block for block in blocks if not block.startswith(AFTER_A_DIAGNOSIS)]


STORIES = {page.stem: story(page) for page in pages() if story(page)}


def test_the_command_has_every_subcommand_and_option_of_a_page():
    entries = [
        (shlex.split(text)[1:], line)
        for text, line in every_command()
        if text.startswith("elastocal ")
    ]
    assert len(entries) > 20
    application = get_command(app)
    for arguments, line in entries:
        command = application
        while arguments and arguments[0] in getattr(command, "commands", {}):
            command = command.commands[arguments[0]]
            arguments = arguments[1:]
        assert (
            not getattr(command, "commands", {})
            or not arguments
            or arguments[0].startswith("-")
        ), (line, arguments)
        options = {
            name
            for option in command.params
            for name in (*option.opts, *option.secondary_opts)
        }
        given = {word.partition("=")[0] for word in arguments if word.startswith("--")}
        assert given <= options | {"--help"}, (line, given - options)


def test_make_knows_its_targets():
    targets = sorted(
        {
            text.split()[1]
            for text, _ in every_command()
            if re.fullmatch(r"make [\w./-]+", text)
        }
    )
    finished = subprocess.run(
        ["make", "-n", *targets], cwd=ROOT, capture_output=True, text=True
    )
    assert len(targets) > 5 and finished.returncode == 0, finished.stderr


def test_targets_of_snakemake_are_rules():
    """A plan of all of them would take minutes."""
    rules = [
        path.read_text(encoding="utf-8")
        for path in (ROOT / "Snakefile", *(ROOT / "workflow" / "rules").glob("*.smk"))
    ]
    rule_names = {
        rule
        for text in rules
        for rule in re.findall(r"^rule (\w+):", text, re.MULTILINE)
    }
    command_words = (
        text.partition(" --")[0].split()[1:]
        for text, _ in every_command()
        if text.startswith("snakemake ")
    )
    targets = {
        argument
        for arguments in command_words
        for argument in arguments
        if re.fullmatch(r"[a-z_]+", argument)
    }
    assert len(targets) > 5 and targets <= rule_names, targets - rule_names


@pytest.mark.slow
@pytest.mark.parametrize("page", STORIES)
def test_a_how_to_page_works_from_top_to_bottom(page, tmp_path):
    Study.of_links(tmp_path)
    binaries = Path(sys.executable).parent
    (tmp_path / ".venv").symlink_to(binaries.parent)
    # A run refuses links below data.
    shutil.copytree(ROOT / "data" / "measured", tmp_path / "data" / "measured")
    script = "set -euo pipefail\n" + "\n".join(STORIES[page])
    environment = os.environ | {
        "PATH": f"{binaries}:{os.environ['PATH']}",
        "OMP_NUM_THREADS": "1",
    }
    finished = subprocess.run(
        ["bash", "-c", script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=environment,
    )
    assert finished.returncode == 0, finished.stdout + finished.stderr
