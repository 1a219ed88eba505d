"""JSON files come back as they were, look as they always did, and appear whole or not at all."""

import pytest

from elastocal.io.json_files import read_json, write_json

CONTENTS = {"pose": [1, 2], "noise": {"unit": "µm", "level": None}}


def test_written_file_has_one_space_of_indent_and_a_final_newline(tmp_path):
    path = tmp_path / "one.json"
    write_json(path, CONTENTS)
    expected = '{\n "pose": [\n  1,\n  2\n ],\n "noise": {\n  "unit": "\\u00b5m",\n  "level": null\n }\n}\n'
    assert path.read_bytes() == expected.encode()
    assert read_json(path) == CONTENTS


def test_nothing_is_left_of_contents_that_are_no_json(tmp_path):
    path = tmp_path / "one.json"
    write_json(path, CONTENTS)
    with pytest.raises(ValueError, match="JSON compliant"):
        write_json(path, {"rms": float("nan")}, allow_nan=False)
    assert read_json(path) == CONTENTS and list(tmp_path.iterdir()) == [path]
