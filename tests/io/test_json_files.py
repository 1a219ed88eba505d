"""JSON files survive writing and reading, have one layout, and are written atomically."""

import pytest
from support import refused

from elastocal.io.json_files import read_json, write_json


def test_a_file_is_indented_and_invalid_json_leaves_the_old_file(tmp_path):
    path = tmp_path / "one.json"
    contents = {"pose": [1], "unit": "µm"}
    write_json(path, contents)
    assert path.read_bytes() == b'{\n "pose": [\n  1\n ],\n "unit": "\\u00b5m"\n}\n'
    with pytest.raises(ValueError, match="JSON compliant"):
        write_json(path, {"rms": float("nan")}, allow_nan=False)
    assert read_json(path) == contents and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000])
def test_what_is_no_json_is_refused_in_one_line(tmp_path, text):
    path = tmp_path / "verdict.json"
    path.write_text(text, encoding="utf-8")
    with refused(path, "", "no JSON", "as the pipeline wrote it"):
        read_json(path)
