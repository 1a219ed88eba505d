"""A small study, run once, and a folder of its own for each test that changes something."""

import subprocess

import pytest
from study_folder import Study


@pytest.fixture(scope="session")
def _serial_run(request, tmp_path_factory):
    """The small study on one core, under way behind the other tests where a test asks for it."""
    if not any("serial_study" in getattr(item, "fixturenames", ()) for item in request.session.items):
        yield None
        return
    study = Study.of_sources(tmp_path_factory.mktemp("serial") / "study")
    with open(study.path("terminal.txt"), "w", encoding="utf-8") as terminal:
        process = subprocess.Popen(**study.command("-j1"), stdout=terminal, stderr=subprocess.STDOUT)
    yield study, process
    if process.poll() is None:
        process.terminate()
        process.wait()


@pytest.fixture(scope="session")
def small_study(_serial_run, tmp_path_factory):
    """The finished small study on two cores; to be read, not to be changed."""
    study = Study.of_sources(tmp_path_factory.mktemp("small") / "study")
    study.run()
    return study


@pytest.fixture(scope="session")
def serial_study(_serial_run):
    """The finished small study on one core; to be read, not to be changed."""
    study, process = _serial_run
    assert process.wait(timeout=600) == 0, study.path("terminal.txt").read_text(encoding="utf-8")[-3000:]
    return study


@pytest.fixture
def finished(small_study, tmp_path):
    """A copy of the finished small study, to be changed."""
    return small_study.copied_to(tmp_path / "study")


@pytest.fixture
def unstarted(tmp_path):
    """The sources of the small study and nothing else, to be changed."""
    return Study.of_sources(tmp_path / "study")
