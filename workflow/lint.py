"""Checks that ruff does not have: Snakemake's own lint and how much a function holds.

Usage: python workflow/lint.py, from the top of the repository.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

from radon.complexity import cc_visit

# Findings of `snakemake --lint` that are allowed, each with its reason.
ALLOWED_FINDINGS = {
    "Specify a conda environment or container for each rule.": (
        "one pinned environment serves all rules: requirements/run.lock"
    ),
}
CHECKED_FOLDERS = ("src", "workflow", "tests", "benchmarks", "docs")
# Cyclomatic complexity above which a function must be split. Radon counts the branches
# inside expressions too; ruff's C901 with its limit of 10 counts statements only.
LARGEST_COMPLEXITY = 15
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)


def unexpected_findings() -> list[str]:
    """Run `snakemake --lint` and return the findings that are not allowed."""
    finished = subprocess.run(
        [sys.executable, "-m", "snakemake", "--lint"], capture_output=True, text=True
    )
    report = finished.stdout + finished.stderr
    findings = re.findall(r"^ +\* (.*):$", report, flags=re.MULTILINE)
    if finished.returncode and not findings:
        return [report]
    return sorted(set(findings) - set(ALLOWED_FINDINGS))


def nested_comprehensions(path: Path, tree: ast.Module) -> list[str]:
    """Return a line for each comprehension that contains another one."""
    lines = []
    for node in ast.walk(tree):
        if isinstance(node, COMPREHENSIONS):
            below = (child for child in ast.walk(node) if child is not node)
            if any(isinstance(child, COMPREHENSIONS) for child in below):
                lines.append(
                    f"{path}:{node.lineno}: a comprehension in a comprehension"
                )
    return lines


def complex_functions(path: Path, text: str) -> list[str]:
    """Return a line for each function above the limit of cyclomatic complexity."""
    return [
        f"{path}:{block.lineno}: {block.fullname} has a complexity of"
        f" {block.complexity}; allowed: {LARGEST_COMPLEXITY}"
        for block in cc_visit(text)
        if block.letter in "FM" and block.complexity > LARGEST_COMPLEXITY
    ]


def shape_findings() -> list[str]:
    """Check the shape of all Python files of the repository."""
    lines = []
    for folder in CHECKED_FOLDERS:
        for path in sorted(Path(folder).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            lines += nested_comprehensions(path, ast.parse(text))
            lines += complex_functions(path, text)
    return lines


if __name__ == "__main__":
    findings = unexpected_findings() + shape_findings()
    if findings:
        sys.exit("\n".join(findings))
    print("workflow/lint.py: no findings")
