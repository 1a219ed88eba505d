"""A catalogue finds the modules beside it, those that have what it asks for."""

import sys
from types import ModuleType

import pytest

from elastocal.io.modules import module_names, modules_with


@pytest.fixture
def package(tmp_path, monkeypatch):
    for name, text in (("b", "NAME = 'two'"), ("a", "NAME = 'one'"), ("shared", "")):
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    found = ModuleType("found_by_themselves")
    found.__path__ = [str(tmp_path)]
    monkeypatch.setitem(sys.modules, found.__name__, found)
    return found


def test_modules_are_found_by_what_they_have_in_the_order_of_their_names(package):
    assert module_names(package) == ["a", "b", "shared"]
    assert {name: module.NAME for name, module in modules_with("NAME", package).items()} == {"a": "one", "b": "two"}
    assert list(modules_with("NAME", package)) == ["a", "b"]
