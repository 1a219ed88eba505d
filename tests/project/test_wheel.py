"""The wheel has all that the package and its pipeline need, and its command runs where
there is no checkout."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
from made_folders import make_folder
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import elastocal
from elastocal.errors import EXTRAS

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
SOURCES = (
    "pyproject.toml",
    "README.md",
    "LICENSE",
    "Snakefile",
    "config.yaml",
    "config",
    "profiles",
    "src",
    "workflow",
)
SOURCES += ("paper", "CITATION.cff", "data/measured")
# Of the checkout alone: it checks, rehearses and explains.
LEFT_OUT = (
    "workflow/conda_package.py",
    "workflow/lint.py",
    "workflow/sizes.py",
    "workflow/examples/",
    "workflow/searches/",
    "config/README.md",
)
OUTSIDE = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | {
    "OMP_NUM_THREADS": "1"
}
IGNORED = shutil.ignore_patterns("__pycache__", "*.egg-info")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built of a copy of the sources, as the build leaves folders behind; without a
    network."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in SOURCES:
        source = ROOT / name
        shutil.copytree(
            source, folder / name, ignore=IGNORED
        ) if source.is_dir() else shutil.copy2(source, folder / name)
    pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]
    alone = ["--no-deps", "--no-build-isolation", "--no-index"]
    done = subprocess.run(
        [*pip, "wheel", *alone, ".", "-w", "dist"],
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    (wheel,) = (folder / "dist").iterdir()
    return wheel


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """An environment with the wheel; the libraries are those of these tests."""
    folder = tmp_path_factory.mktemp("installed")
    venv.create(folder, symlinks=True)
    packages = Path(sysconfig.get_path("purelib", "venv", {"base": folder}))
    (packages / "libraries.pth").write_text(sysconfig.get_path("purelib"))
    pip = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        str(folder),
        "-q",
        "--disable-pip-version-check",
    ]
    done = subprocess.run(
        [*pip, "install", "--no-deps", "--no-index", str(wheel)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return folder


def find_distributions(names):
    """Return the distributions of some names and all that they require here."""
    waiting = [*names]
    found = {}
    while waiting:
        name = canonicalize_name(waiting.pop())
        if name in found:
            continue
        found[name] = metadata.distribution(name)
        requirements = map(Requirement, found[name].requires or ())
        waiting += [
            requirement.name
            for requirement in requirements
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""})
        ]
    return found


def find_base_distributions():
    """Return the distributions that the wheel requires without an extra, by name."""
    required = map(Requirement, PROJECT["dependencies"])
    return find_distributions([requirement.name for requirement in required])


def measure_mb(distribution):
    """Return what a distribution takes of the disk without bytecode, MB."""
    paths = map(distribution.locate_file, distribution.files)
    kept = (path for path in paths if path.suffix != ".pyc" and path.is_file())
    return 1e-6 * sum(path.stat().st_size for path in kept)


@pytest.fixture(scope="module")
def base(wheel, tmp_path_factory):
    """An environment with the wheel and its base requirements: links to the packages of
    these tests, so that nothing is downloaded."""
    folder = tmp_path_factory.mktemp("base")
    venv.create(folder, symlinks=True, with_pip=False)
    packages = Path(sysconfig.get_path("purelib", "venv", {"base": folder}))
    for distribution in find_base_distributions().values():
        for entry in {file.parts[0] for file in distribution.files} - {".."}:
            link = packages / entry
            if not link.exists():
                link.symlink_to(distribution.locate_file(entry))
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(packages)
    return folder


@pytest.fixture
def run(installed, tmp_path):
    """Call a program of that environment in a folder that is no checkout."""

    def called(program, *words):
        command = [str(installed / "bin" / program), *map(str, words)]
        return subprocess.run(
            command, cwd=tmp_path, env=OUTSIDE, capture_output=True, text=True
        )

    return called


def files_of(folder):
    files = (path for path in (ROOT / folder).rglob("*") if path.is_file())
    return {
        path.relative_to(ROOT).as_posix()
        for path in files
        if not {"__pycache__"} & set(path.parts)
    }


def package_files():
    files = (name for name in files_of("src") if ".egg-info/" not in name)
    return {name.removeprefix("src/") for name in files}


def pipeline_files():
    files = {"Snakefile", "config.yaml", "paper/paper.bib", "CITATION.cff"}
    for folder in ("config", "data/measured", "profiles", "workflow"):
        files.update(files_of(folder))
    return {name for name in files if not name.startswith(LEFT_OUT)}


@pytest.mark.slow
def test_the_wheel_has_all_files_of_package_and_pipeline_and_states_its_licence(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if not name.endswith("/")}
        (path,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        metadata = archive.read(path).decode()
    contents = {
        name.rpartition(".data/data/share/elastocal/")[2]
        for name in names
        if ".dist-info/" not in name
    }
    assert contents == package_files() | pipeline_files()
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names)
    for line in (
        f"Version: {elastocal.__version__}",
        "Author: the elastocal developers",
        "License-Expression: MIT",
    ):
        assert f"\n{line}\n" in metadata


@pytest.mark.slow
def test_the_installed_pipeline_reads_a_campaign_in_the_working_directory(
    installed, run, tmp_path, kuka
):
    """A robot of config/robots; the first step runs, and what the others read is looked
    for: a diagnosis takes too long."""
    make_folder(tmp_path / "cell", kuka)
    snakefile = installed / "share" / "elastocal" / "Snakefile"
    for target in (["results/loop/made/campaign.json"], ["diagnose", "-n", "-p"]):
        tokens = [
            "-m",
            "snakemake",
            *target,
            "--snakefile",
            snakefile,
            "-j1",
            "--config",
            f"campaign={tmp_path / 'cell'}",
        ]
        done = run("python", *tokens)
        assert done.returncode == 0, done.stderr[-2000:]
    assert (tmp_path / "results" / "loop" / "made" / "training.parquet").is_file()
    assert "reports/loop/made/report.html" in done.stdout
    assert "/site-packages/elastocal/report/loop.typ" in done.stdout
    assert f"{ROOT}/src" not in done.stdout


@pytest.mark.slow
def test_base_requirements_suffice_from_arrays_to_corrected_targets(base):
    """None of the packages of an extra is installed there."""
    example = [base / "bin" / "python", "workflow/examples/five_lines.py"]
    done = subprocess.run(
        example, cwd=ROOT, env=OUTSIDE, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    *_, last = done.stdout.splitlines()
    assert last == f"not installed: {' '.join(EXTRAS)}"
    assert "gear transmission error" in done.stdout


@pytest.mark.slow
def test_the_page_says_how_much_an_installation_takes(wheel):
    """With the pinned versions, in which the environment of these tests has them."""
    page = (ROOT / "docs" / "how_to" / "use_from_python.md").read_text("utf-8")
    sizes_mb = {
        name: measure_mb(distribution)
        for name, distribution in find_base_distributions().items()
    }
    with zipfile.ZipFile(wheel) as archive:
        own_mb = 1e-6 * sum(member.file_size for member in archive.infolist())
    assert f"and {sum(sizes_mb.values()) + own_mb:.0f} MB on disk" in page
    largest = (
        f"pyarrow {sizes_mb['pyarrow']:.0f} MB,"
        f" numpy and scipy {sizes_mb['numpy'] + sizes_mb['scipy']:.0f} MB,"
        f" pandas {sizes_mb['pandas']:.0f} MB,"
        f" scikit-learn {sizes_mb['scikit-learn']:.0f} MB"
    )
    assert largest in " ".join(page.split())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "package", "extra"),
    [(["demo"], "mujoco", "proof"), (["diagnose", "cell"], "snakemake", "pipeline")],
)
def test_a_command_names_the_extra_of_a_package_that_is_not_installed(
    words, package, extra, base, tmp_path, kuka
):
    make_folder(tmp_path / "cell", kuka)
    done = subprocess.run(
        [base / "bin" / "python", "-m", "elastocal", *words],
        cwd=tmp_path,
        env=OUTSIDE,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1
    assert done.stderr == (
        f"Python: found no package {package}; allowed: an environment with it: in the"
        f" clone of elastocal, python -m pip install -e '.[{extra}]'\n"
    )
