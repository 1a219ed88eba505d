"""A byte that was altered after a step wrote it is found by the step that reads it."""

import subprocess
from pathlib import Path

import pytest
from support import refused

from elastocal.io.checksums import check_checksums, checksum, record_checksums

FILES = ("reports/tables/a.csv", "results/loop/made/diagnosis.json", "data/sealed/block")


@pytest.fixture(autouse=True)
def written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in (*FILES[:2], "data/sealed/block/1/case.json", "data/sealed/block/2/case.json"):
        Path(name).parent.mkdir(parents=True)
        Path(name).write_bytes(bytes(range(256)))
    record_checksums(FILES)


def test_what_nobody_altered_passes():
    check_checksums(FILES)


@pytest.mark.parametrize("place", [0, 100, 255])
@pytest.mark.parametrize(
    ("file", "altered"), [(FILES[0], FILES[0]), (FILES[1], FILES[1]), (FILES[2], "data/sealed/block/2/case.json")]
)
def test_any_altered_byte_is_found(file, altered, place):
    content = bytearray(Path(altered).read_bytes())
    content[place] ^= 1
    Path(altered).write_bytes(content)
    again = "it" if altered == file else file
    with refused(altered, "", "other contents than were written", f"delete {again} and it is made again"):
        check_checksums(FILES)
    record_checksums(FILES)
    check_checksums(FILES)


@pytest.mark.parametrize("name", FILES)
def test_files_of_another_folder_are_found_too(tmp_path, monkeypatch, name):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    check_checksums(FILES, tmp_path)
    file = next(path for path in (tmp_path / name, *sorted((tmp_path / name).rglob("*.json"))) if path.is_file())
    file.write_bytes(b"")
    with refused(file, "", "other contents than were written"):
        check_checksums(FILES, tmp_path)


def test_a_file_that_is_taken_away_or_added_to_a_folder_is_found():
    Path("data/sealed/block/3.json").write_text("")
    with refused("data/sealed/block/3.json", "", "other contents"):
        check_checksums(FILES)
    Path("data/sealed/block/3.json").unlink()
    Path("data/sealed/block/1/case.json").unlink()
    with refused("data/sealed/block/1/case.json", "", "other contents"):
        check_checksums(FILES)


def test_the_time_that_snakemake_notes_in_a_folder_is_no_part_of_it():
    Path("data/sealed/block/.snakemake_timestamp").touch()
    check_checksums(FILES)


def test_what_is_missing_not_recorded_or_not_made_here_is_not_judged(tmp_path):
    Path(FILES[0]).unlink()
    for name in ("data/new.csv", "own/a.csv", "a.csv"):
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text("1")
    names = ["data/new.csv", "own/a.csv", "a.csv", f"{tmp_path}/data/new.csv", "data/../a.csv"]
    record_checksums(names[1:])
    assert len([file for file in Path("results/checksums").rglob("*") if file.is_file()]) == len(FILES)
    check_checksums([FILES[0], *names])


def test_sha256sum_reads_the_records():
    folder = Path(f"results/checksums/{FILES[2]}.sha256").read_text().splitlines()
    assert [line.split("  ")[1] for line in folder] == ["data/sealed/block/1/case.json", "data/sealed/block/2/case.json"]
    lines = Path(f"results/checksums/{FILES[0]}.sha256").read_text()
    assert lines == f"{checksum(FILES[0])}  {FILES[0]}\n"
    done = subprocess.run(["sha256sum", "--check"], input=lines, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout == f"{FILES[0]}: OK\n"
