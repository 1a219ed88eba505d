"""A count and its noun agree, wherever a message or a report has one."""

import re
from pathlib import Path

from elastocal.counting import counted, first_names, grouped

# A count in a message, of what may be one and is not a limit, with its noun written by hand.
_BY_HAND = re.compile(
    r"\{(?:len\((?!controller\.AXES)[^{}]*\)|[\w.]+\.sum\(\)|number|poses|found\.skipped)\} "
    r"(?:rows|lines|cells|poses|entries|targets|joints|measurements|values|remarks|numbers)\b(?! are (?:too )?few)"
)


def test_one_thing_is_no_plural_and_thousands_are_grouped():
    assert counted(1, "row") == "1 row" and counted(0, "row") == "0 rows" and counted(2, "entry", "entries") == "2 entries"
    assert counted(12000, "pose") == "12\u2009000 poses" and grouped(-1234567) == "-1\u2009234\u2009567"


def test_of_many_names_the_first_are_written_and_the_others_counted():
    assert first_names(["a", "b"], 2) == "a, b" and first_names(["a", "b", "c", "d", "e"], 2) == "a, b and 3 more"


def test_messages_of_bad_input_and_of_commands_write_no_plural_by_hand():
    rooms = ("command", "exchange", "campaigns", "mechanics", "application", "loop", "diagnosis", "validation")
    files = [file for room in rooms for file in sorted(Path("src/elastocal", room).rglob("*.py"))]
    found = {f"{file}: {match[0]}" for file in files for match in _BY_HAND.finditer(file.read_text(encoding="utf-8"))}
    assert not found
