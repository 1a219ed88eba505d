"""`elastocal diagnose`: the Snakemake target of a campaign, with its progress, verdict and report."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from elastocal.command.checkout import checkout


def diagnose(
    folder: Annotated[Path, typer.Argument(help="Folder of the campaign.")],
    cores: Annotated[int, typer.Option("--cores", "-j", min=1, help="Jobs at a time.")] = 2,
) -> None:
    """Find what the model of a robot lacks, and report the error before and after on held-out poses."""
    words = ["-m", "snakemake", f"-j{cores}", "diagnose", "--config", f"campaign={folder.resolve()}"]
    raise typer.Exit(subprocess.run([sys.executable, *words], cwd=checkout(), check=False).returncode)
