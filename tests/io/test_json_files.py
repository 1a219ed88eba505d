"""JSON files come back as they were, look as they always did, and appear whole or not
at all."""

import pytest

from elastocal.io.json_files import read_json, write_json


def test_written_file_has_one_space_of_indent_and_a_final_newline_and_none_is_left_of_what_is_no_json(
    tmp_path,
):
    path = tmp_path / "one.json"
    contents = {"pose": [1], "unit": "µm"}
    write_json(path, contents)
    assert path.read_bytes() == b'{\n "pose": [\n  1\n ],\n "unit": "\\u00b5m"\n}\n'
    with pytest.raises(ValueError, match="JSON compliant"):
        write_json(path, {"rms": float("nan")}, allow_nan=False)
    assert read_json(path) == contents and list(tmp_path.iterdir()) == [path]
