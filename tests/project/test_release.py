"""A release: one version, licence and list of requirements in every file, files of the
form that hosts ask for, one way out."""

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

import elastocal

ROOT = Path(__file__).resolve().parents[2]
# Names that conda has for packages of the index.
CONDA = {
    "snakemake": "snakemake-minimal",
    "matplotlib": "matplotlib-base",
    "typst": "typst-py",
}
AUTHORS = "the elastocal developers"
# Schemas that come with check-jsonschema, so that nothing is downloaded.
CHECKED = {
    "citation-file-format": ["CITATION.cff"],
    "github-workflows": [
        f".github/workflows/{name}.yml" for name in ("ci", "nightly", "release")
    ],
    "github-issue-forms": [
        f".github/ISSUE_TEMPLATE/{name}.yml"
        for name in ("fault", "verdict", "proposal")
    ],
    "dependabot": [".github/dependabot.yml"],
    "github-issue-config": [".github/ISSUE_TEMPLATE/config.yml"],
}


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


PROJECT = tomllib.loads(text("pyproject.toml"))["project"]


@pytest.mark.parametrize("schema", CHECKED)
def test_a_file_is_of_its_schema(schema):
    tokens = [
        sys.executable,
        "-m",
        "check_jsonschema",
        "--builtin-schema",
        f"vendor.{schema}",
        *CHECKED[schema],
    ]
    done = subprocess.run(tokens, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_form_is_checked():
    forms = {
        path.relative_to(ROOT).as_posix() for path in (ROOT / ".github").rglob("*.yml")
    }
    assert forms == {
        name
        for names in CHECKED.values()
        for name in names
        if name.startswith(".github/")
    }


def test_public_ci_makes_the_targets_of_ours_in_their_order():
    steps = yaml.safe_load(text(".github/workflows/ci.yml"))["jobs"]["check"]["steps"]
    public = "\n".join(step.get("run", "") for step in steps)
    ours = text(".ci/run")
    made = [
        re.findall(r"^(?:step \w+ )?make ([a-z-]+)", script, re.MULTILINE)
        for script in (public, ours)
    ]
    assert made == 2 * [["lint", "paper", "study", "pictures", "test"]]


def test_every_file_has_the_version_and_the_licence_of_the_package():
    citation = yaml.safe_load(text("CITATION.cff"))
    codemeta = json.loads(text("codemeta.json"))
    assert citation["version"] == codemeta["version"] == elastocal.__version__
    assert f"({elastocal.__version__})" in text(
        "CHANGELOG.md"
    ) or f"## {elastocal.__version__} " in text("CHANGELOG.md")
    assert "version" in PROJECT["dynamic"]
    assert (
        PROJECT["license"]
        == citation["license"]
        == codemeta["license"].rpartition("/")[2]
        == "MIT"
    )
    assert text("LICENSE").startswith("MIT License\n") and f" {AUTHORS}\n" in text(
        "LICENSE"
    )


def test_the_recipe_has_the_version_and_all_requirements_of_a_checkout():
    recipe = yaml.safe_load(text("recipe/recipe.yaml"))
    assert recipe["context"]["version"] == elastocal.__version__
    run = dict(
        line.split()
        for line in recipe["requirements"]["run"]
        if isinstance(line, str) and " " in line
    )
    assert run.pop("python") == PROJECT["requires-python"]
    extras = PROJECT["optional-dependencies"]
    texts = [*PROJECT["dependencies"]]
    for extra in ("report", "pipeline", "proof"):
        texts += [text for text in extras[extra] if not text.startswith("elastocal[")]
    requirements = map(Requirement, texts)
    assert run == {
        CONDA.get(requirement.name, requirement.name): str(requirement.specifier)
        for requirement in requirements
    }
    (script,) = recipe["build"]["python"]["entry_points"]
    assert script.split(" = ") == ["elastocal", PROJECT["scripts"]["elastocal"]]


def test_only_a_tag_publishes_and_only_the_job_without_our_code_may():
    release = yaml.safe_load(text(".github/workflows/release.yml"))
    # YAML 1.1 reads the key "on" as true.
    assert release[True] == {"push": {"tags": ["v[0-9]+.[0-9]+.[0-9]+"]}} and release[
        "permissions"
    ] == {"contents": "read"}
    jobs = release["jobs"]
    assert "permissions" not in jobs["build"] and jobs["publish"]["needs"] == "build"
    assert any(
        "make installed" in step.get("run", "") for step in jobs["build"]["steps"]
    )
    ran = [step["run"] for step in jobs["publish"]["steps"] if "run" in step]
    assert (
        len(ran) == 2
        and "--require-hashes" in ran[0]
        and "--trusted-publishing always" in ran[1]
    )


def test_papers_cite_what_their_bibliography_has():
    """That of the software, and that of the study, whose labels of figures and tables
    look like references."""
    cited = set(re.findall(r"@([\w:-]+)", text("paper/paper.md").split("---\n", 2)[2]))
    study = text("src/elastocal/report/study.typ")
    labels = set(re.findall(r"<(\w+)>", study)) | set(
        re.findall(r'tag: "(\w+)"', study)
    )
    cited |= set(re.findall(r"(?<!\w)@(\w+)", study)) - labels
    assert cited == set(
        re.findall(r"^@\w+\{([\w:-]+),$", text("paper/paper.bib"), re.MULTILINE)
    )


def test_every_figure_of_the_paper_is_one_of_a_page():
    quotations = re.findall(
        r"<!-- (README\.md|docs/\w+\.md): (.*?) -->", text("paper/paper.md")
    )
    assert len(quotations) >= 4
    assert [
        (page, quotation)
        for page, quotation in quotations
        if quotation not in text(page)
    ] == []


def test_an_older_python_is_refused_in_a_line_before_anything_is_installed(tmp_path):
    """A resolver would say that some package has no version for it."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    shutil.copytree(ROOT / "requirements", tmp_path / "requirements")
    older = tmp_path / "python3.10"
    older.write_text(
        f"""#!/bin/sh
exec {sys.executable} -c "import sys; sys.version_info = (3, 10, 12); $2"
""",
        encoding="utf-8",
    )
    older.chmod(0o755)
    command = ["make", f"PYTHON={older}", ".venv/made"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    line = "elastocal needs Python 3.11 or later, and this is Python 3.10"
    assert done.returncode != 0 and line in done.stderr
    assert not (tmp_path / ".venv").exists()
