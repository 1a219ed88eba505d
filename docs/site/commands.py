"""The page of all commands, as `elastocal` itself describes them."""

from __future__ import annotations

import subprocess
import sys

HEAD = """# Commands

Made of the code; `elastocal COMMAND --help` says the same. What they do, one by one: [the commands](../docs/afternoon.md).

"""


def page() -> str:
    """Every command with its arguments and options, in Markdown, as typer writes it.

    A process of its own: what the terminal is must not change the page.
    """
    called = [sys.executable, "-m", "typer", "elastocal.command.main", "utils", "docs", "--name", "elastocal"]
    written = subprocess.run(called, capture_output=True, text=True, check=True).stdout
    return HEAD + written.replace("\n# ", "\n## ").removeprefix("# `elastocal`\n")
