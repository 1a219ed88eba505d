"""What no linter of Python looks at: Snakemake's own lint, but for findings that are
allowed, and the lines of each room. Usage: python workflow/lint.py, from the top of the
repository.
"""

import re
import subprocess
import sys
from pathlib import Path

# Each finding with its reason.
ALLOWED = {
    "Specify a conda environment or container for each rule.": "one pinned environment serves all: requirements/run.lock",
}
# Most lines of Python of each room. Who needs more changes this table in the same
# commit and says why; rooms are to shrink.
ROOMS = {
    "src/elastocal/application": 1810,
    "src/elastocal/campaigns": 1600,
    "src/elastocal/command": 1130,
    "src/elastocal/data_checks": 710,
    "src/elastocal/diagnosis": 3750,
    "src/elastocal/effects": 1680,
    "src/elastocal/exchange": 1800,
    "src/elastocal/figures": 1330,
    "src/elastocal/fitting": 1920,
    "src/elastocal/io": 970,
    "src/elastocal/loop": 900,
    "src/elastocal/mechanics": 1140,
    "src/elastocal/remainder": 840,
    "src/elastocal/report": 1250,
    "src/elastocal/study": 2930,
    "src/elastocal/validation": 500,
    "src/elastocal_proof/audit": 940,
    "src/elastocal_proof/blind": 1880,
    "src/elastocal_proof/figures": 320,
    "src/elastocal_proof/league": 410,
    "src/elastocal_proof/plant": 1720,
    "src/elastocal_proof/report": 100,
    "tests": 22320,
    "workflow": 2650,
}


def rooms_too_large() -> list[str]:
    """A line for each room with more lines than it may have."""
    found = []
    for room, most in ROOMS.items():
        files = [file for kind in ("*.py", "*.smk") for file in Path(room).rglob(kind)]
        lines = sum(file.read_text(encoding="utf-8").count("\n") for file in files)
        if lines > most:
            found.append(
                f"{room}: found {lines} lines; allowed: {most} (ROOMS of workflow/lint.py)"
            )
    return found


if __name__ == "__main__":
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "--lint"], capture_output=True, text=True
    )
    report = done.stdout + done.stderr
    findings = re.findall(r"^ +\* (.*):$", report, flags=re.MULTILINE)
    if set(findings) - set(ALLOWED) or (done.returncode and not findings):
        sys.exit(report)
    if large := rooms_too_large():
        sys.exit("\n".join(large))
    print(
        f"snakemake --lint: clean, but for {len(findings)} allowed findings; {len(ROOMS)} rooms within their lines"
    )
