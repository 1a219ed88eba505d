"""A language is one file: what lies in the package is offered, by its name and by the suffix of its files."""

import sys

from support import refused

import elastocal.exchange.controllers
from elastocal.exchange.controllers.catalogue import controller_of, controllers
from elastocal.exchange.controllers.protocol import Controller

MINE = """
NAME, WORDS, SUFFIX = "mine", "a language of mine", ".mine"
AXES, EXTERNAL, PROGRAM, RESERVED = ("X",), (), (r"[a-z]+", "letters"), ""


def program(name, targets):
    return f"{name}: {targets.rows(AXES)}"
"""


def test_four_are_there_each_whole_and_with_a_suffix_of_its_own():
    found = controllers()
    suffixes = {name: module.SUFFIX for name, module in found.items()}
    assert suffixes == {"krl": ".src", "rapid": ".mod", "tp": ".ls", "urscript": ".script"}
    assert len({module.SUFFIX for module in found.values()}) == len(found)
    for module in found.values():
        assert {*Controller.__annotations__, "program"} <= set(vars(module)) and "After " in module.__doc__


def test_another_file_in_the_package_is_another_language_and_nothing_else_changes(tmp_path, monkeypatch):
    before = set(controllers())
    (tmp_path / "mine.py").write_text(MINE)
    monkeypatch.setattr(elastocal.exchange.controllers, "__path__", [*elastocal.exchange.controllers.__path__, str(tmp_path)])
    try:
        assert set(controllers()) == before | {"mine"}
        assert controller_of("", ".mine").WORDS == controller_of("mine", "").WORDS == "a language of mine"
        with refused("--format", "'karel'", "mine"):
            controller_of("karel", "")
    finally:
        sys.modules.pop("elastocal.exchange.controllers.mine", None)
