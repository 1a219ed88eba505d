"""A file that may be the only copy of somebody's work is not replaced."""

import pytest

from elastocal.errors import InputError
from elastocal.io.replacement import (
    WRITTEN_FILES,
    check_replaceable,
    note_written_files,
)


@pytest.fixture
def targets(tmp_path):
    path = tmp_path / "targets.csv"
    path.write_text("q1\n0.1\n")
    return path


def test_a_file_that_does_not_exist_may_be_written(tmp_path):
    check_replaceable([tmp_path / "new.csv"], [], tmp_path, force=False)


def test_a_file_that_no_command_has_written_is_refused(targets, tmp_path):
    with pytest.raises(
        InputError, match=r"no command of elastocal has written.*--force"
    ):
        check_replaceable([targets], [], tmp_path, force=False)


def test_a_written_file_may_be_replaced_until_somebody_changes_it(targets, tmp_path):
    note_written_files([targets], tmp_path)
    check_replaceable([targets], [], tmp_path, force=False)
    targets.write_text("q1\n0.2\n")
    with pytest.raises(InputError, match="changed since"):
        check_replaceable([targets], [], tmp_path, force=False)


def test_an_input_is_refused_under_any_name_even_if_a_command_wrote_it(
    targets, tmp_path
):
    note_written_files([targets], tmp_path)
    link = tmp_path / "link"
    link.symlink_to(tmp_path, target_is_directory=True)
    with pytest.raises(InputError, match="this command reads"):
        check_replaceable([targets], [link / targets.name], tmp_path, force=False)


def test_force_replaces_inputs_and_files_of_the_user(targets, tmp_path):
    check_replaceable([targets], [targets], tmp_path, force=True)


def test_force_replaces_no_link(targets, tmp_path):
    link = tmp_path / "link.csv"
    link.symlink_to(targets)
    with pytest.raises(InputError, match="link"):
        check_replaceable([link], [], tmp_path, force=True)


@pytest.mark.parametrize("damage", ["", "[1]", "[" * 100_000])
def test_with_a_damaged_list_every_file_counts_as_the_users(targets, tmp_path, damage):
    note_written_files([targets], tmp_path)
    (tmp_path / WRITTEN_FILES).write_text(damage)
    with pytest.raises(InputError, match="no command of elastocal has written"):
        check_replaceable([targets], [], tmp_path, force=False)


def test_files_that_are_gone_leave_the_list(targets, tmp_path):
    note_written_files([targets], tmp_path)
    targets.unlink()
    note_written_files([], tmp_path)
    assert (tmp_path / WRITTEN_FILES).read_text().split() == ["{}"]
