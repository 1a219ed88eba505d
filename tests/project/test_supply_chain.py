"""What is installed is used, CI and container run pins with the rights that they need,
and SECURITY.md names its tests."""

import re
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

from elastocal import errors

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
]
JOBS = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))[
    "jobs"
]
WORKFLOW = (ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8")
RECIPE = (ROOT / "docker" / "Dockerfile").read_text(encoding="utf-8")
SECURITY = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
# Where a run begins, of what a wheel has too.
RUN = [
    *ROOT.glob("src/**/*.py"),
    *ROOT.glob("workflow/rules/*.py"),
    *ROOT.glob("workflow/scripts/*.py"),
]
AUDIT = [path for path in RUN if "audit" in path.parts]
EXTRAS = PROJECT["optional-dependencies"]
# Extras of what a checkout runs, beside the base requirements.
RUN_EXTRAS = ("report", "pipeline", "proof")
# What pandas writes Markdown by.
IMPORTED_BY_OTHERS = {"tabulate"}
# It is where its package's own list of modules does not have it.
DISTRIBUTIONS = packages_distributions() | {"pinocchio": ["pin"]}


def names(requirements):
    return {Requirement(text).name.lower() for text in requirements} - {"elastocal"}


REQUIRED = names(PROJECT["dependencies"]).union(
    *(names(EXTRAS[extra]) for extra in RUN_EXTRAS)
)


def imported(paths):
    """Return the packages of each module that files import, also within functions.

    Several packages may share a module.
    """
    pattern = re.compile(r"^ *(?:from|import) (\w+)", re.MULTILINE)
    modules = set()
    for path in paths:
        modules.update(pattern.findall(path.read_text(encoding="utf-8")))
    packages_by_module = []
    for module in modules:
        names = DISTRIBUTIONS.get(module)
        if names:
            packages_by_module.append(
                {name.lower().replace("_", "-") for name in names}
            )
    return packages_by_module


def test_what_every_user_installs_is_imported_by_what_every_user_runs():
    """A package that a test alone needs is of the extra test: cvxpy once was not, with
    10 packages and 234 MB."""
    assert REQUIRED - set().union(*imported(RUN)) == IMPORTED_BY_OTHERS


def test_messages_name_the_extra_of_each_package():
    modules = {"pin": "pinocchio", "opencv-python-headless": "cv2"}
    packages = {
        modules.get(name, name): extra
        for extra in (*RUN_EXTRAS, "audit", "camera")
        for name in names(EXTRAS[extra])
        # Snakemake brings it.
        if name != "snakemake-interface-logger-plugins"
    }
    assert packages == errors.EXTRAS


def test_what_a_run_imports_is_installed_and_audit_and_camera_need_their_extras():
    # Snakemake's plug-ins use its interfaces, which come with it.
    given = REQUIRED | {"elastocal"}
    assert [
        packages for packages in imported(set(RUN) - set(AUDIT)) if not packages & given
    ] == [names(EXTRAS["camera"])]
    audit = names(EXTRAS["audit"])
    assert (
        [packages for packages in imported(AUDIT) if not packages & given]
        == [audit]
        == [{"pin"}]
    )


@pytest.mark.parametrize("name", ["run", "cluster"])
def test_the_pins_of_a_run_and_of_the_container_have_nothing_of_tests_and_audit(name):
    pinned = set(
        re.findall(
            r"^([a-z0-9-]+)==",
            (ROOT / "requirements" / f"{name}.lock").read_text(encoding="utf-8"),
            re.MULTILINE,
        )
    )
    assert pinned >= REQUIRED
    assert pinned & (names(EXTRAS["audit"]) | {"cvxpy", "pytest", "yourdfpy"}) == set()


def steps():
    return [(name, step) for name, job in JOBS.items() for step in job["steps"]]


def test_an_action_is_named_by_its_commit_beside_its_version():
    uses = re.findall(r"uses: (.*)", WORKFLOW)
    assert len(uses) == len([step for _, step in steps() if "uses" in step]) > 5
    assert [
        line
        for line in uses
        if not re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", line)
    ] == []
    assert len({line.partition("@")[0] for line in uses}) == len(set(uses)), (
        "one action at two commits"
    )


def test_a_job_may_read_alone_but_for_the_one_that_signs_and_runs_nothing_else():
    assert yaml.safe_load(WORKFLOW)["permissions"] == {"contents": "read"}
    more = {
        name: job["permissions"] for name, job in JOBS.items() if "permissions" in job
    }
    assert more == {"attest": {"attestations": "write", "id-token": "write"}}
    assert JOBS["attest"]["if"] == "github.event_name != 'pull_request'"
    assert [step["uses"].partition("@")[0] for step in JOBS["attest"]["steps"]] == [
        "actions/download-artifact",
        *2 * ["actions/attest"],
    ]


def test_a_wheel_is_made_after_the_check_for_vulnerabilities_and_signed_with_the_list_of_packages():
    commands = [step["run"] for step in JOBS["wheel"]["steps"] if "run" in step]
    assert commands[0] == "make supply" and " pip wheel " in commands[1]
    recipe = (
        (ROOT / "Makefile")
        .read_text(encoding="utf-8")
        .split("\nsupply:")[1]
        .split("\n\n")[0]
    )
    assert (
        "cyclonedx-py environment" in recipe
        and "-o sbom.cdx.json" in recipe
        and "pip-audit" in recipe
    )
    signed = [step["with"] for step in JOBS["attest"]["steps"][1:]]
    assert signed == [
        {"subject-path": "dist/*.whl"},
        {"subject-path": "dist/*.whl", "sbom-path": "sbom.cdx.json"},
    ]
    assert JOBS["wheel"]["steps"][-1]["with"]["path"].split() == [
        "dist/*.whl",
        "sbom.cdx.json",
    ]


def test_the_container_copies_what_is_there_and_is_handed_nothing_else():
    copied = {
        name
        for line in re.findall(r"^COPY (.*) \S+$", RECIPE, re.MULTILINE)
        for name in line.split()
    }
    assert [name for name in copied if not (ROOT / name).exists()] == []
    assert {
        "Snakefile",
        "config.yaml",
        "config",
        "profiles",
        "src",
        "workflow",
        "pyproject.toml",
    } <= copied
    rules = (
        (ROOT / "docker" / "Dockerfile.dockerignore")
        .read_text(encoding="utf-8")
        .splitlines()
    )
    assert (
        "*" in rules and {rule[1:] for rule in rules if rule.startswith("!")} == copied
    )


def test_it_installs_by_digest_and_names_no_index():
    assert (
        RECIPE.count("--require-hashes") == 2
        and "http" not in RECIPE
        and "index" not in RECIPE
    )


def test_its_base_is_one_image_and_what_it_runs_is_not_root():
    """The user comes after all that installs, before what runs; one whom the image does
    not know has a home and a name."""
    assert re.findall(
        r"^FROM \S+@sha256:[0-9a-f]{64}$", RECIPE, re.MULTILINE
    ) == re.findall(r"^FROM .*", RECIPE, re.MULTILINE)
    assert re.search(r"^ENV HOME=/tmp USER=\w+$", RECIPE, re.MULTILINE)
    instructions = re.findall(r"^[A-Z]+ .*", RECIPE, re.MULTILINE)
    assert re.fullmatch(r"USER [1-9]\d*:[1-9]\d*", instructions[-2]) and instructions[
        -1
    ].startswith("ENTRYPOINT ")


def test_every_sentence_of_the_security_page_names_a_test_that_is_there():
    named = set(re.findall(r"`(test_\w+)`", SECURITY))
    files = (path.read_text("utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    assert len(named) > 10 and named <= {
        name for file in files for name in re.findall(r"def (test_\w+)", file)
    }
    for paragraph in ("Writing", "At the door", "Supply chain", "What a pass rests on"):
        body = " ".join(
            SECURITY.split(f"**{paragraph}.** ")[1].split("\n\n")[0].split()
        )
        assert [
            sentence
            for sentence in re.split(r"(?<=[.)])\s+(?=[A-Z])", body)
            if "`test_" not in sentence
        ] == []
