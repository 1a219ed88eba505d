"""A command as it is typed."""

import pytest
from typer.testing import CliRunner

from elastocal.command.main import app
from elastocal.errors import InputError


def called(*words):
    """Result of a command; its words may be paths and numbers."""
    return CliRunner().invoke(app, [*map(str, words)])


@pytest.fixture(scope="session")
def elastocal():
    return called


@pytest.fixture(scope="session")
def refusal():
    """The line in which a command refuses its input."""

    def line(*words):
        error = called(*words).exception
        assert isinstance(error, InputError) and len(str(error).splitlines()) == 1, (
            error
        )
        return str(error)

    return line


@pytest.fixture
def in_checkout(checkout, monkeypatch):
    """That checkout as the working directory."""
    monkeypatch.chdir(checkout)
    return checkout
