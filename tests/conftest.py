"""Fixtures of all tests: robots, strategies and the configuration of the repository, and
checkouts with a diagnosed campaign."""

import gc
import os
import shutil
import sys
from pathlib import Path

import hypothesis
import pytest

from elastocal.io.documents import check_document, read_document
from elastocal.mechanics.robot_file import parse_robot
from elastocal.study.strategies import strategy_from_document

# An environment may forbid Python to write compiled modules. Compiling them again would
# take half of a test run.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

CONFIG = Path(__file__).resolve().parents[1] / "config"

# Every run draws the same examples, so that a failing test fails again. A slow machine
# is no fault.
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
        choices=["none", "all", "one"],
        default="none",
        help="run slow tests: none, all, or those of one file",
    )
    parser.addoption(
        "--commit",
        default="0",
        help="hexadecimal number that chooses the one file of slow tests",
    )


def pytest_collection_modifyitems(config, items):
    """Deselect slow tests unless they are asked for, and run the files that take longest
    first, so that no worker has one left at the end: slow ones, then those that run the
    workflow.

    The tests of a file stay together because they share fixtures.
    """
    slow = sorted({item.path for item in items if item.get_closest_marker("slow")})
    number = int(config.getoption("commit")[:8], 16) % max(len(slow), 1)
    selections = {"none": [], "all": slow, "one": slow[number : number + 1]}
    chosen = selections[config.getoption("slow")]
    deselected = []
    kept = []
    for item in items:
        is_skipped = item.path not in chosen and item.get_closest_marker("slow")
        (deselected if is_skipped else kept).append(item)
    config.hook.pytest_deselected(items=deselected)
    items[:] = sorted(
        kept,
        key=lambda item: (
            item.path not in chosen,
            item.path.parent.name != "workflow",
        ),
    )


def pytest_collection_finish(session):
    """Take the collected tests and the imported libraries out of garbage collection,
    which otherwise searches them again and again, for a twelfth of the time of the
    tests."""
    gc.freeze()


def load_robot(key):
    """Read a robot of the repository by the name of its file."""
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
    strategies = {}
    for path in sorted((CONFIG / "strategies").glob("*.yaml")):
        document = read_document(path)
        check_document(document, "strategy", path)
        strategies[path.stem] = strategy_from_document(document)
    return strategies


@pytest.fixture(scope="session")
def config(config_folder):
    """The configuration of the repository."""
    return read_document(config_folder.parent / "config.yaml")


@pytest.fixture
def blank_figures(request, monkeypatch):
    """Files of figures are blank, except in tests marked ``drawn``.

    Rendering takes two thirds of the time of a command. Tests that do not look at the
    pictures still compose each figure, and write files of its size and format.
    """
    # Most tests never load the library of figures.
    from matplotlib.figure import Figure

    if request.node.get_closest_marker("drawn"):
        return
    render = Figure.savefig

    def save_blank(figure, *path, **options):
        render(Figure(figure.get_size_inches()), *path, **options)

    monkeypatch.setattr(Figure, "savefig", save_blank)


@pytest.fixture(scope="session")
def made_checkout(tmp_path_factory):
    """A checkout with the diagnosed campaign ``made``, which no test may change."""
    # This module imports the whole loop, which only few tests need.
    from certified import certified_checkout

    top = tmp_path_factory.mktemp("made")
    certified_checkout(top)
    return top


@pytest.fixture(scope="module")
def checkout(made_checkout, tmp_path_factory):
    """A copy of the checkout that the tests of a file may change."""
    return shutil.copytree(
        made_checkout, tmp_path_factory.mktemp("checkout") / "top", symlinks=True
    )


@pytest.fixture(scope="session")
def regressed_checkout(tmp_path_factory):
    """A checkout with the diagnosed campaign ``smooth`` of a robot whose errors only a
    regression can describe."""
    from certified import certified_checkout
    from made_remainders import smoothly_wrong_folder

    top = tmp_path_factory.mktemp("regressed")
    changes = {"poses": 150, "frame": "tracker", "remainder": "gaussian_process"}
    certified_checkout(
        top, "smooth", made=lambda *words: smoothly_wrong_folder(*words, **changes)
    )
    return top
