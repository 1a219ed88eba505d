"""Where the tests of a module are: every module of both packages has a file of its
name, in the folder of its room."""

from pathlib import Path

import pytest

from elastocal.effects import catalogue

TESTS = Path(__file__).resolve().parent
SOURCES = [TESTS.parent / "src" / name for name in ("elastocal", "elastocal_proof")]
# Tests of the catalogue and of closed forms go through all of them.
EFFECTS = {
    f"effects/{effect.listed.__module__.rpartition('.')[2]}.py"
    for effect in catalogue.list_bundled_effects().values()
}


def modules():
    return sorted(
        path.relative_to(top).as_posix()
        for top in SOURCES
        for path in top.rglob("*.py")
        if path.name != "__init__.py"
    )


@pytest.mark.parametrize(
    "module", [module for module in modules() if module not in EFFECTS]
)
def test_a_module_has_a_file_of_tests_of_its_name(module):
    path = Path(module)
    mirror = TESTS / path.parent / f"test_{path.name}"
    there = mirror.is_file() and "\ndef test_" in mirror.read_text(encoding="utf-8")
    assert there, f"{module} has no tests in {mirror.relative_to(TESTS.parent)}"


@pytest.mark.parametrize(
    "room", [path for top in SOURCES for path in top.rglob("__init__.py")], ids=str
)
def test_a_room_that_only_says_what_it_is_needs_no_tests(room):
    """What an `__init__` would do is in no mirror."""
    text = room.read_text(encoding="utf-8")
    assert "\ndef " not in text and "\nclass " not in text
