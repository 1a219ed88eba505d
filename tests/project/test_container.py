"""The container recipe copies files that are there, and all that the pipeline needs."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RECIPE = (ROOT / "docker" / "Dockerfile").read_text(encoding="utf-8")
COPIED = {name for line in re.findall(r"^COPY (.*) \S+$", RECIPE, re.MULTILINE) for name in line.split()}


def test_what_it_copies_is_there_and_is_what_the_pipeline_is_made_of():
    assert [name for name in COPIED if not (ROOT / name).exists()] == []
    assert {"Snakefile", "config.yaml", "config", "profiles", "src", "workflow", "pyproject.toml"} <= COPIED


def test_it_installs_by_digest_and_names_no_index():
    assert RECIPE.count("--require-hashes") == 2
    assert "http" not in RECIPE and "index" not in RECIPE


def test_an_engine_is_handed_what_is_copied_and_nothing_else():
    rules = (ROOT / "docker" / "Dockerfile.dockerignore").read_text(encoding="utf-8").splitlines()
    assert "*" in rules and {rule[1:] for rule in rules if rule.startswith("!")} == COPIED


def test_a_user_whom_the_image_does_not_know_has_a_home_and_a_name():
    """As with `docker run --user "$(id -u)"`; Snakemake stops without either."""
    assert re.search(r"^ENV HOME=/tmp USER=\w+$", RECIPE, re.MULTILINE)


def test_its_base_is_one_image_and_what_it_runs_is_not_root():
    """The user comes after all that installs, and before what runs."""
    assert re.findall(r"^FROM \S+@sha256:[0-9a-f]{64}$", RECIPE, re.MULTILINE) == re.findall(r"^FROM .*", RECIPE, re.MULTILINE)
    instructions = re.findall(r"^[A-Z]+ .*", RECIPE, re.MULTILINE)
    assert re.fullmatch(r"USER [1-9]\d*:[1-9]\d*", instructions[-2]) and instructions[-1].startswith("ENTRYPOINT ")
