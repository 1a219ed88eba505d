"""Snakemake's own lint, except for the findings that are allowed here.
 Usage: python workflow/lint.py, from the top of the
repository.
"""

import re
import subprocess
import sys

# Each finding with its reason.
ALLOWED = {
    "Specify a conda environment or container for each rule.": "one pinned environment serves all: requirements/run.lock",
}

if __name__ == "__main__":
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "--lint"], capture_output=True, text=True
    )
    report = done.stdout + done.stderr
    findings = re.findall(r"^ +\* (.*):$", report, flags=re.MULTILINE)
    if set(findings) - set(ALLOWED) or (done.returncode and not findings):
        sys.exit(report)
    print(f"snakemake --lint: clean, but for {len(findings)} allowed findings")
