"""Variables of MAT files, and the one line of what is none."""

import io

import numpy as np
import pytest
import scipy.io
from support import refused

from elastocal.campaigns.importers import mat_files
from elastocal.campaigns.importers.mat_files import read_mat


def mat(**values):
    stream = io.BytesIO()
    scipy.io.savemat(stream, values)
    return stream.getvalue()


def test_variables_that_are_there_are_read(tmp_path):
    path = tmp_path / "a.mat"
    path.write_bytes(mat(q=np.eye(3), other=np.ones(2)))
    found = read_mat(path, ["q", "none"])
    assert list(found) == ["q"]
    np.testing.assert_array_equal(found["q"], np.eye(3))


WHOLE = mat(q=np.arange(60.0).reshape(10, 6))


@pytest.mark.parametrize(
    "content",
    [b"", b"text", WHOLE[:100], WHOLE[:200], WHOLE[:-100], WHOLE[:128] + b"\xff" * 400, b"MATLAB 7.3 MAT-file".ljust(600)],
    # Whole files state the second in which they were written, and the workers of pytest need one name.
    ids=["empty", "text", "100 bytes", "200 bytes", "without its end", "noise", "version 7.3"],
)
def test_a_damaged_file_is_one_line_without_the_words_of_a_library(tmp_path, content):
    path = tmp_path / "a.mat"
    path.write_bytes(content)
    with refused(path, "", f"damaged ({len(content)} bytes)", "a MAT file of version 5"):
        read_mat(path, ["q"])


def test_a_missing_file_a_folder_and_a_larger_one_are_one_line(tmp_path, monkeypatch):
    with refused(tmp_path / "none.mat", "", "found no such file"):
        read_mat(tmp_path / "none.mat", ["q"])
    with refused(tmp_path, "", "a folder"):
        read_mat(tmp_path, ["q"])
    monkeypatch.setattr(mat_files, "LARGEST_BYTES", 100)
    (tmp_path / "a.mat").write_bytes(WHOLE)
    with refused(tmp_path / "a.mat", "", "more than 100 bytes"):
        read_mat(tmp_path / "a.mat", ["q"])
