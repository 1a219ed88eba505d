"""A command as it is typed."""

import pytest
from certified import certified_checkout
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
        assert isinstance(error, InputError) and len(str(error).splitlines()) == 1, error
        return str(error)

    return line


@pytest.fixture(scope="module")
def top(tmp_path_factory):
    """A checkout with the diagnosed campaign ``made`` in it."""
    found = tmp_path_factory.mktemp("cell")
    certified_checkout(found)
    return found


@pytest.fixture
def there(top, monkeypatch):
    """That checkout as the working directory."""
    monkeypatch.chdir(top)
    return top
