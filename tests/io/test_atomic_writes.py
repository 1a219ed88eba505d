"""Files that appear whole or not at all."""

from pathlib import Path

import pytest

from elastocal.io.atomic_writes import atomic_write, write_text


def test_a_file_appears_only_once_it_is_complete(tmp_path):
    path = tmp_path / "one.txt"
    with atomic_write(path) as partial:
        Path(partial).write_text("half", encoding="utf-8")
        assert not path.exists() and Path(partial).parent == tmp_path
    assert path.read_text(encoding="utf-8") == "half" and list(tmp_path.iterdir()) == [path]


def test_what_was_there_is_replaced_as_a_whole(tmp_path):
    path = tmp_path / "one.txt"
    path.write_text("much longer than what follows", encoding="utf-8")
    with atomic_write(str(path)) as partial:
        Path(partial).write_text("new", encoding="utf-8")
        assert path.read_text(encoding="utf-8").startswith("much longer")
    assert path.read_text(encoding="utf-8") == "new"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_block_that_fails_leaves_the_old_file_and_no_other(tmp_path, error):
    path = tmp_path / "one.txt"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(error), atomic_write(path) as partial:
        Path(partial).write_text("half", encoding="utf-8")
        raise error
    assert path.read_text(encoding="utf-8") == "old" and list(tmp_path.iterdir()) == [path]


def test_a_block_that_fails_before_it_writes_raises_its_own_error(tmp_path):
    with pytest.raises(ValueError, match="mine"), atomic_write(tmp_path / "one.txt"):
        raise ValueError("mine")
    assert not list(tmp_path.iterdir())


def test_a_block_that_writes_nothing_is_an_error_and_keeps_the_old_file(tmp_path):
    (tmp_path / "one.txt").write_text("old", encoding="utf-8")
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "one.txt"):
        pass
    assert (tmp_path / "one.txt").read_text(encoding="utf-8") == "old"


def test_texts_are_written_as_utf_8(tmp_path):
    write_text(tmp_path / "one.txt", "5 µm\n")
    assert (tmp_path / "one.txt").read_bytes() == b"5 \xc2\xb5m\n" and len(list(tmp_path.iterdir())) == 1
