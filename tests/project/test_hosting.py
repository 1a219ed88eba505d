"""Files for public hosting: of the form that their readers ask for, and of the targets and tools of this repository."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
# Schemas that come with check-jsonschema, so that nothing is downloaded.
CHECKED = {
    "citation-file-format": ["CITATION.cff"],
    "github-workflows": [f".github/workflows/{name}.yml" for name in ("ci", "nightly", "release")],
    "github-issue-forms": [f".github/ISSUE_TEMPLATE/{name}.yml" for name in ("fault", "verdict", "proposal")],
    "dependabot": [".github/dependabot.yml"],
    "github-issue-config": [".github/ISSUE_TEMPLATE/config.yml"],
}


def loaded(name):
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


@pytest.mark.parametrize("schema", CHECKED)
def test_a_file_is_of_its_schema(schema):
    words = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", f"vendor.{schema}", *CHECKED[schema]]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_form_is_checked():
    forms = {path.relative_to(ROOT).as_posix() for path in (ROOT / ".github").rglob("*.yml")}
    assert forms == {name for names in CHECKED.values() for name in names if name.startswith(".github/")}


TARGETS = ["lint", "paper", "test"]


def make_targets(text):
    return re.findall(r"^(?:step \w+ )?make ([a-z-]+)", text, re.MULTILINE)


def test_public_ci_makes_the_targets_of_ours_in_their_order():
    steps = loaded(".github/workflows/ci.yml")["jobs"]["check"]["steps"]
    public = make_targets("\n".join(step["run"] for step in steps if "run" in step))
    assert public == make_targets((ROOT / ".ci" / "run").read_text(encoding="utf-8")) == TARGETS
