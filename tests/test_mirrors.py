"""Every module of both packages has a test file of its name, in the folder of its
package."""

from pathlib import Path

import pytest

from elastocal.effects import catalogue

TESTS = Path(__file__).resolve().parent
SOURCES = [TESTS.parent / "src" / name for name in ("elastocal", "elastocal_proof")]
# The tests of the catalogue and of closed forms cover all effects.
EFFECTS = {
    f"effects/{effect.listed.__module__.rpartition('.')[2]}.py"
    for effect in catalogue.list_bundled_effects().values()
}


def list_modules():
    """Return the paths of all modules within their packages."""
    return sorted(
        path.relative_to(top).as_posix()
        for top in SOURCES
        for path in top.rglob("*.py")
        if path.name != "__init__.py"
    )


@pytest.mark.parametrize(
    "module", [module for module in list_modules() if module not in EFFECTS]
)
def test_every_module_has_a_test_file_of_its_name(module):
    path = Path(module)
    mirror = TESTS / path.parent / f"test_{path.name}"
    has_tests = mirror.is_file() and "\ndef test_" in mirror.read_text(encoding="utf-8")
    assert has_tests, f"{module} has no tests in {mirror.relative_to(TESTS.parent)}"


@pytest.mark.parametrize(
    "path", [path for top in SOURCES for path in top.rglob("__init__.py")], ids=str
)
def test_an_init_file_defines_nothing_unless_it_has_a_test_file(path):
    """Only the top of the package has one: it imports its public names on first use."""
    text = path.read_text(encoding="utf-8")
    has_tests = path.parent == SOURCES[0] and (TESTS / "test___init__.py").is_file()
    assert has_tests or ("\ndef " not in text and "\nclass " not in text)
