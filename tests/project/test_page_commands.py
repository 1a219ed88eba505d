"""Commands that pages show: their targets, subcommands and options are there, and
how-to pages work from top to bottom."""

import os
import re
import shlex
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
# How-to pages are run from top to bottom, each in a folder of its own, up to a command
# of these: they need a diagnosis, which the scripts have.
AFTER_A_DIAGNOSIS = (
    "elastocal certificate",
    "elastocal correct",
    "elastocal export",
    "elastocal diagnose",
)


def pages():
    found = [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
        *ROOT.glob("[bcdr]*/README.md"),
    ]
    return sorted(
        page
        for page in found
        if page.name not in ("paper.md", "CHANGELOG.md") and "site" not in page.parts
    )


def as_typed(line):
    """A line of a shell without its comment, blanks that align it, and the folder of
    the environment."""
    words = re.sub(r"\s+#.*", "", line.strip())
    return " ".join(words.split()).replace(".venv/bin/", "").replace(r"\|", "|")


def begins_a_command(text):
    words = text.split()
    while words and re.fullmatch(r"\w+=\S*", words[0]):
        words.pop(0)
    return (
        bool(words)
        and (words[0] in PROGRAMS or words[0].startswith("workflow/"))
        and len(words) > 1
    )


def shell_lines(text):
    """Lines of a block as the shell takes them: continued ones joined, here-documents
    left out."""
    without = re.sub(
        r"<<'(\w+)'\n.*?\n\1$", r"<<'\1'", text, flags=re.DOTALL | re.MULTILINE
    )
    return re.sub(r"\\\n\s*", " ", without).splitlines()


def commands(page):
    """Commands of a page with their lines: of blocks, and those within sentences that
    have more than a name."""
    found = []
    for token in MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8")):
        lines = []
        if token.type in ("fence", "code_block") and token.info.strip() in (
            "",
            *SHELLS,
        ):
            typed = [as_typed(line) for line in shell_lines(token.content)]
            lines = [
                line
                for line in typed
                if token.info.strip() in SHELLS or begins_a_command(line)
            ]
        inline = [
            as_typed(child.content)
            for child in token.children or ()
            if child.type == "code_inline"
        ]
        lines += [
            line for line in inline if begins_a_command(line) and "=…" not in line
        ]
        found += [
            (line, f"{page.relative_to(ROOT)}:{token.map[0] + 1}")
            for line in lines
            if line and not line.startswith("#")
        ]
    return found


def every_command():
    return [entry for page in pages() for entry in commands(page)]


def story(page):
    """What a how-to page types, until something needs a diagnosed campaign; None of
    another page."""
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


def test_every_subcommand_and_option_of_a_page_is_one_of_the_command():
    found = [
        (shlex.split(text)[1:], where)
        for text, where in every_command()
        if text.startswith("elastocal ")
    ]
    assert len(found) > 20
    for words, where in found:
        command = get_command(app)
        while words and words[0] in getattr(command, "commands", {}):
            command = command.commands[words[0]]
            words = words[1:]
        assert (
            not getattr(command, "commands", {})
            or not words
            or words[0].startswith("-")
        ), (where, words)
        options = {
            name
            for option in command.params
            for name in (*option.opts, *option.secondary_opts)
        }
        asked = {word.partition("=")[0] for word in words if word.startswith("--")}
        assert asked <= options | {"--help"}, (where, asked - options)


def test_make_knows_its_targets():
    targets = sorted(
        {
            text.split()[1]
            for text, _ in every_command()
            if re.fullmatch(r"make [\w./-]+", text)
        }
    )
    ran = subprocess.run(
        ["make", "-n", *targets], cwd=ROOT, capture_output=True, text=True
    )
    assert len(targets) > 5 and ran.returncode == 0, ran.stderr


def test_targets_of_snakemake_are_rules():
    """What a plan of them would say takes minutes."""
    rules = [
        path.read_text(encoding="utf-8")
        for path in (ROOT / "Snakefile", *(ROOT / "workflow" / "rules").glob("*.smk"))
    ]
    known = {
        rule
        for text in rules
        for rule in re.findall(r"^rule (\w+):", text, re.MULTILINE)
    }
    asked = (
        text.partition(" --")[0].split()[1:]
        for text, _ in every_command()
        if text.startswith("snakemake ")
    )
    targets = {
        word for words in asked for word in words if re.fullmatch(r"[a-z_]+", word)
    }
    assert len(targets) > 5 and targets <= known, targets - known


@pytest.mark.slow
@pytest.mark.parametrize("page", STORIES)
def test_a_how_to_page_works_from_top_to_bottom(page, tmp_path):
    Study.of_links(tmp_path)
    binaries = Path(sys.executable).parent
    (tmp_path / ".venv").symlink_to(binaries.parent)
    script = "set -euo pipefail\n" + "\n".join(STORIES[page])
    environment = os.environ | {
        "PATH": f"{binaries}:{os.environ['PATH']}",
        "OMP_NUM_THREADS": "1",
    }
    ran = subprocess.run(
        ["bash", "-c", script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=environment,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
