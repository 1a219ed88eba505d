"""The page of all commands, as `elastocal` itself describes them."""

from __future__ import annotations

import re
import subprocess
import sys
from textwrap import dedent

import typer.main

from elastocal.command.main import app

# Where a terminal must not join lines, help texts have the character \\b, which a page
# would show.
_EXAMPLE = re.compile(r"^\x08\n(Examples?):\n((?:  .+\n)+)", re.MULTILINE)
HEAD = """# Commands

Made from the code; `elastocal COMMAND --help` prints the same. [The commands, one by
one](../docs/command_reference.md) explains them.

"""


def page() -> str:
    """Write every command with its arguments and options, in Markdown, as typer writes it.

    A process of its own: what the terminal is must not change the page.
    """
    called = [
        sys.executable,
        "-m",
        "typer",
        "elastocal.command.main",
        "utils",
        "docs",
        "--name",
        "elastocal",
    ]
    written = subprocess.run(called, capture_output=True, text=True, check=True).stdout
    written = _EXAMPLE.sub(
        lambda match: f"{match[1]}:\n\n```console\n{dedent(match[2])}```\n", written
    )
    return HEAD + _with_whole_summaries(written).replace("\n# ", "\n## ").removeprefix(
        "# `elastocal`\n"
    )


def _with_whole_summaries(written: str) -> str:
    """The lists of commands with the first sentence of each, which typer cuts off to
    fit a terminal."""
    commands = [typer.main.get_command(app)]
    for command in commands:
        commands += getattr(command, "commands", {}).values()
    for command in commands[1:]:
        summary = " ".join((command.help or "").partition("\n\n")[0].split())
        written = re.sub(
            rf"^\* `{command.name}`: .*\.\.\.$",
            lambda _, c=command.name, s=summary: f"* `{c}`: {s}",
            written,
            flags=re.M,
        )
    return written
