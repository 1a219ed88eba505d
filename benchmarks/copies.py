"""Copies of the study in a temporary folder, and Snakemake in them."""

import ast
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from common import ROOT

_TOUCH = """
for path in snakemake.output:
    open(path, "w").close()
"""
# A job ends before those start that depend on it: in the order of these names every job
# finds what it needs.
_RECORD = """
import pickle, time
with open(f"{jobs}/{{time.time_ns()}}-{script}", "wb") as file:
    pickle.dump(snakemake, file)
"""
SOURCES = (
    "Snakefile",
    "CITATION.cff",
    "paper",
    "config.yaml",
    "config",
    "workflow",
    "profiles",
    "src",
)


def copy_study(folder: Path) -> Path:
    """Copy the sources of the study, without anything that it has made.

    `folder`: created. Returns `folder`.
    """
    folder.mkdir()
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(
                ROOT / name,
                folder / name,
                ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"),
            )
        else:
            shutil.copy(ROOT / name, folder / name)
    return folder


def reduce_to_records(folder: Path) -> None:
    """Rewrite the scripts of a copy: they import nothing of ours, touch their outputs
    and record their job in ``jobs/``.

    `folder`: from `copy_study`.
    """
    (folder / "jobs").mkdir()
    for script in _scripts(folder):
        script.write_text(
            _TOUCH + _RECORD.format(script=script.name, jobs=folder / "jobs"),
            encoding="utf-8",
        )


def _scripts(folder: Path) -> list[Path]:
    """Scripts of jobs: what they import from beside them runs in none by itself."""
    texts = {
        path: path.read_text(encoding="utf-8")
        for path in sorted((folder / "workflow" / "scripts").glob("*.py"))
    }
    nodes = (node for text in texts.values() for node in ast.parse(text).body)
    imported = {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
    return [path for path in texts if path.stem not in imported]


def snakemake(folder: Path, *arguments: str) -> tuple[float, str]:
    """Run Snakemake in a copy, with the package of the copy.

    Returns `output`: what it printed. Raises `SystemExit` where it fails; with what it
    printed.
    """
    environment = os.environ | {"PYTHONPATH": str(folder / "src")}
    command = [sys.executable, "-m", "snakemake", *arguments]
    start = time.perf_counter()
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True
    )
    seconds = time.perf_counter() - start
    if done.returncode:
        sys.exit(f"{done.stdout}{done.stderr}\nfailed: {' '.join(command)} in {folder}")
    return seconds, done.stdout + done.stderr
