"""Fixtures: the robots and strategies of the repository's own config."""

import os
import shutil
import sys
from pathlib import Path

import hypothesis
import pytest

from elastocal.io.documents import check_document, read_document
from elastocal.mechanics.robot_file import parse_robot
from elastocal.study.strategies import strategy_from_document

# An environment may forbid programs to keep what they compile; half of a run of the
# tests would be compiling.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

CONFIG = Path(__file__).resolve().parents[1] / "config"

# The same examples in every run: a test that fails must fail again. A machine that is
# too slow to draw them is no fault.
hypothesis.settings.register_profile(
    "repeatable",
    deadline=None,
    max_examples=40,
    derandomize=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("repeatable")


def pytest_addoption(parser):
    parser.addoption(
        "--slow",
        choices=["none", "all", "part"],
        default="none",
        help="run slow tests: none, all, or a tenth",
    )
    parser.addoption(
        "--part",
        default="0",
        help="hexadecimal number, as of a commit, that chooses the tenth of the slow tests",
    )


def pytest_collection_modifyitems(config, items):
    """Files of minutes first, so that no worker is left alone with one at the end; slow
    tests where they are asked for.

    A file's tests, which share what they make, stay together: each tenth has every
    tenth of the slow files.
    """
    slow = sorted({item.path for item in items if item.get_closest_marker("slow")})
    asked = config.getoption("slow")
    part = int(config.getoption("part")[:8], 16) % 10
    chosen = {"none": [], "all": slow, "part": slow[part::10]}[asked]
    left_out = [
        item
        for item in items
        if item.path not in chosen and item.get_closest_marker("slow")
    ]
    config.hook.pytest_deselected(items=left_out)
    kept = [
        item
        for item in items
        if item.path in chosen or not item.get_closest_marker("slow")
    ]
    items[:] = sorted(kept, key=lambda item: item.path.parent.name != "workflow")


def load_robot(key):
    path = CONFIG / "robots" / f"{key}.yaml"
    document = read_document(path)
    check_document(document, "robot", path)
    return parse_robot(document, path)


@pytest.fixture(scope="session")
def config_folder():
    return CONFIG


@pytest.fixture(scope="session")
def kuka():
    return load_robot("kuka")


@pytest.fixture(scope="session")
def fanuc():
    return load_robot("fanuc")


@pytest.fixture(scope="session")
def kuka_extended():
    return load_robot("kuka_extended")


@pytest.fixture(scope="session", params=["kuka", "fanuc"])
def robot(request):
    """Each of the paper's two robots in turn."""
    return load_robot(request.param)


@pytest.fixture(scope="session")
def strategies():
    """The paper's eight strategies by the names of their files."""
    found = {}
    for path in sorted((CONFIG / "strategies").glob("*.yaml")):
        document = read_document(path)
        check_document(document, "strategy", path)
        found[path.stem] = strategy_from_document(document)
    return found


@pytest.fixture(scope="session")
def config(config_folder):
    """The repository's own configuration."""
    return read_document(config_folder.parent / "config.yaml")


@pytest.fixture(scope="session")
def made_checkout(tmp_path_factory):
    """A checkout with the diagnosed campaign ``made`` in it, to be read."""
    # Imports the whole loop, which few tests need.
    from certified import certified_checkout

    top = tmp_path_factory.mktemp("made")
    certified_checkout(top)
    return top


@pytest.fixture(scope="module")
def checkout(made_checkout, tmp_path_factory):
    """A copy, to be changed by the tests of a file."""
    return shutil.copytree(
        made_checkout, tmp_path_factory.mktemp("checkout") / "top", symlinks=True
    )


@pytest.fixture(scope="session")
def regressed_checkout(tmp_path_factory):
    """A checkout with the diagnosed campaign ``smooth`` in it, of a robot that errs by
    what only a regression has."""
    from certified import certified_checkout
    from made_remainders import smoothly_wrong_folder

    top = tmp_path_factory.mktemp("regressed")
    changes = {"poses": 150, "frame": "tracker", "remainder": "gaussian_process"}
    certified_checkout(
        top, "smooth", made=lambda *words: smoothly_wrong_folder(*words, **changes)
    )
    return top
