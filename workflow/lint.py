"""Snakemake's own lint, with the findings that this repository lives with named here, each with its reason.

Usage: python workflow/lint.py, from the top of the repository.
"""

import re
import subprocess
import sys

ALLOWED = {
    "Specify a conda environment or container for each rule.": "one pinned environment serves all: requirements/run.lock",
}

if __name__ == "__main__":
    found = subprocess.run([sys.executable, "-m", "snakemake", "--lint"], capture_output=True, text=True)
    report = found.stdout + found.stderr
    findings = re.findall(r"^ +\* (.*):$", report, flags=re.MULTILINE)
    unexpected = [finding for finding in findings if finding not in ALLOWED]
    if unexpected or (found.returncode and not findings):
        sys.exit(report)
    print(f"snakemake --lint: clean, but for {len(findings)} allowed findings")
