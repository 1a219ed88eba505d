"""A file appears complete or not at all."""

import subprocess
import sys
from pathlib import Path

import pytest

from elastocal.io import atomic_writes
from elastocal.io.atomic_writes import (
    remove_partials,
    write_atomically,
    write_text,
    write_together,
)


@pytest.mark.parametrize("before", [None, "much longer than what follows"])
def test_a_file_appears_when_it_is_complete_and_replaces_the_old_one(tmp_path, before):
    path = tmp_path / "one.txt"
    if before:
        path.write_text(before, encoding="utf-8")
    with write_atomically(str(path)) as partial:
        Path(partial).write_text("half", encoding="utf-8")
        assert (
            Path(partial).parent == tmp_path
            and (path.read_text(encoding="utf-8") if path.exists() else None) == before
        )
    assert path.read_text(encoding="utf-8") == "half" and list(tmp_path.iterdir()) == [
        path
    ]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_block_that_fails_leaves_the_old_file_and_no_other(tmp_path, error):
    path = tmp_path / "one.txt"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(error), write_atomically(path) as partial:
        Path(partial).write_text("half", encoding="utf-8")
        raise error
    with pytest.raises(FileNotFoundError), write_atomically(path):
        pass
    assert path.read_text(encoding="utf-8") == "old" and list(tmp_path.iterdir()) == [
        path
    ]


def test_partial_files_have_random_names_and_are_opened_exclusively(
    tmp_path, monkeypatch
):
    names = set()
    for _ in range(20):
        with write_atomically(tmp_path / "one.txt") as partial:
            names.add(partial)
            Path(partial).write_text("x")
    assert len(names) == 20
    monkeypatch.setattr(atomic_writes.secrets, "token_hex", lambda _: "foreseen")
    (tmp_path / "victim").write_text("mine")
    (tmp_path / "one.txt.foreseen.partial").symlink_to(tmp_path / "victim")
    with pytest.raises(FileExistsError), write_atomically(tmp_path / "one.txt"):
        raise AssertionError("never written")
    with pytest.raises(FileExistsError), write_together(tmp_path, ["one.txt"]):
        raise AssertionError("never written")
    assert (tmp_path / "victim").read_text() == "mine"


def test_old_files_are_removed_before_the_first_new_one_appears(tmp_path, monkeypatch):
    """At each rename, no old file is next to a new one, and the user's files stay."""
    for name in ("a", "b", "c", "mine"):
        (tmp_path / name).write_text("old")
    rename = Path.rename
    states = []

    def rename_and_record(path, target):
        rename(path, target)
        states.append(
            {
                file.name: file.read_text()
                for file in tmp_path.iterdir()
                if file.is_file()
            }
        )

    monkeypatch.setattr(Path, "rename", rename_and_record)
    with write_together(tmp_path, ["a", "b", "c"]) as partial:
        for name in "ab":
            (partial / name).write_text("new")
        assert (tmp_path / "a").read_text() == "old"
    assert states == [
        {"a": "new", "mine": "old"},
        {"a": "new", "b": "new", "mine": "old"},
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", "mine"]


def test_files_that_belong_together_appear_together_or_the_old_ones_stay(tmp_path):
    with write_together(tmp_path / "deep/new", ["a"]) as partial:
        write_text(partial / "a", "a")
        assert not (tmp_path / "deep/new").exists()
    assert [path.name for path in (tmp_path / "deep/new").iterdir()] == ["a"]
    (tmp_path / "a").write_text("old")
    for folder in (tmp_path, tmp_path / "new"):
        with (
            pytest.raises(ValueError, match="mine"),
            write_together(folder, ["a"]) as partial,
        ):
            (partial / "a").write_text("new")
            raise ValueError("mine")
    assert (tmp_path / "a").read_text() == "old" and sorted(
        path.name for path in tmp_path.iterdir()
    ) == ["a", "deep"]


def test_only_partial_files_of_killed_runs_are_removed(tmp_path):
    partial = tmp_path / "a" / f"one.parquet.{'0f' * 8}.partial"
    partial.parent.mkdir()
    partial.touch()
    (tmp_path / f"new.{'0f' * 8}.partial").mkdir()
    (tmp_path / f"new.{'0f' * 8}.partial" / "file").touch()
    (tmp_path / "mine.partial").touch()
    remove_partials(tmp_path)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a", "mine.partial"]


def test_partial_files_of_a_living_process_stay(tmp_path):
    """A run that begins while a command writes leaves the command's files alone."""
    with (
        write_atomically(tmp_path / "one.txt") as partial,
        write_together(tmp_path / "new", ["a"]) as folder,
    ):
        Path(partial).write_text("1")
        (folder / "a").write_text("2")
        remover = "from elastocal.io.atomic_writes import remove_partials as remove;"
        subprocess.run(
            [sys.executable, "-c", f"{remover} remove({str(tmp_path)!r})"], check=True
        )
    assert (tmp_path / "one.txt").read_text() == "1"
    assert (tmp_path / "new" / "a").read_text() == "2"


def test_partial_files_of_a_killed_process_go(tmp_path):
    script = f"""
import os
from elastocal.io.atomic_writes import write_atomically, write_together
with write_atomically({str(tmp_path / "one.txt")!r}) as partial:
    with write_together({str(tmp_path / "new")!r}, ["a"]):
        os.kill(os.getpid(), 9)
"""
    subprocess.run([sys.executable, "-c", script], check=False)
    assert len(list(tmp_path.iterdir())) == 2
    remove_partials(tmp_path)
    assert not list(tmp_path.iterdir())
