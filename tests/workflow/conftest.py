"""A small study, made once for all workers, and a folder of its own for each test that
changes something."""

import fcntl
import os
import shutil

import pytest
from study_folder import PAPER, TINY, Study


def made_once(factory, name, changes, *arguments):
    """A finished run on two cores, by a small study with `changes`: the worker that
    asks first makes it, others wait for it.

    To be read, not to be changed.
    """
    base = factory.getbasetemp()
    study = Study((base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name)
    with open(study.folder.with_suffix(".lock"), "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = study.folder.with_suffix(".done")
        if not done.exists():
            shutil.rmtree(study.folder, ignore_errors=True)
            Study.of_sources(study.folder, changes).run(*arguments)
            done.touch()
    return study


@pytest.fixture(scope="session")
def paper(tmp_path_factory):
    """Tables and figures of the paper for one robot, finished."""
    return made_once(tmp_path_factory, "paper", TINY, PAPER)


@pytest.fixture
def finished_paper(paper, tmp_path):
    """A copy, to be changed."""
    return paper.copied_to(tmp_path / "study")


@pytest.fixture(scope="session")
def small_study(tmp_path_factory):
    """The whole study of two robots, finished: for slow tests."""
    return made_once(tmp_path_factory, "small", {}, PAPER, "study")


@pytest.fixture(scope="session")
def small_proof(tmp_path_factory):
    """The smallest blind benchmark, finished; not by the seed of the proof: what is looked
    at here is not part of it."""
    return made_once(
        tmp_path_factory, "proof", {"seed": 31}, "blind", "--config", "blind=smoke"
    )


@pytest.fixture
def finished(small_study, tmp_path):
    """A copy of the finished small study, to be changed."""
    return small_study.copied_to(tmp_path / "study")


@pytest.fixture
def unstarted(tmp_path):
    """The sources and nothing else, to be changed."""
    return Study.of_sources(tmp_path / "study", TINY)
