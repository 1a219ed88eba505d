"""A release: its recipe asks for what the wheel asks for, CI installs it, and only a tag of its version publishes it."""

import tomllib
from pathlib import Path

import yaml
from packaging.requirements import Requirement

import elastocal

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# Names that conda has for packages of the index.
CONDA = {"snakemake": "snakemake-minimal", "matplotlib": "matplotlib-base", "typst": "typst-py"}


def loaded(name):
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


def asked_for():
    requirements = map(Requirement, PROJECT["dependencies"])
    return {CONDA.get(each.name, each.name): str(each.specifier) for each in requirements}


def by_name(lines):
    return dict(line.split() for line in lines if isinstance(line, str) and " " in line)


def test_the_recipe_has_the_version_and_the_requirements_of_the_wheel():
    recipe = loaded("recipe/recipe.yaml")
    assert recipe["context"]["version"] == elastocal.__version__
    run = by_name(recipe["requirements"]["run"])
    assert run.pop("python") == PROJECT["requires-python"]
    assert run == asked_for()
    (script,) = recipe["build"]["python"]["entry_points"]
    assert script.split(" = ") == ["elastocal", PROJECT["scripts"]["elastocal"]]


def test_only_a_tag_publishes_and_only_the_job_without_our_code_may():
    release = loaded(".github/workflows/release.yml")
    # YAML 1.1 reads the key "on" as true.
    assert release[True] == {"push": {"tags": ["v[0-9]+.[0-9]+.[0-9]+"]}} and release["permissions"] == {"contents": "read"}
    jobs = release["jobs"]
    assert "permissions" not in jobs["build"] and jobs["publish"]["needs"] == "build"
    assert any("make installed" in step.get("run", "") for step in jobs["build"]["steps"])
    ran = [step["run"] for step in jobs["publish"]["steps"] if "run" in step]
    assert len(ran) == 2 and "--require-hashes" in ran[0] and "--trusted-publishing always" in ran[1]
