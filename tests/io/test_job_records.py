"""Records of jobs: written and read back, and followed from a file to all that it was made from."""

from dataclasses import replace

import pytest

from elastocal.errors import InputError
from elastocal.io.job_records import RECORDS, JobRecord, jobs_behind, read_job_records, write_job_record
from elastocal.io.origin import Origin

ORIGIN = Origin("c0ffee", "d16e57", 1)
MEASURE = JobRecord(
    "measure", {"robot": "kuka"}, "2026-01-01T00:00:01+00:00", "2026-01-01T00:00:02+00:00", ("a",), ("b",), ORIGIN
)
FIT = replace(MEASURE, rule="fit", started="2026-01-01T00:00:03+00:00", inputs=("b", "settings"), outputs=("c", "d"))
DRAW = replace(MEASURE, rule="draw", started="2026-01-01T00:00:04+00:00", inputs=("d",), outputs=("e",))
OTHER = replace(MEASURE, rule="other", inputs=("a",), outputs=("f",))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_record_is_read_back_as_it_was(folder):
    write_job_record("results/logs/fit/kuka/200um.log", FIT)
    write_job_record("results/logs/draw.log", DRAW)
    assert read_job_records() == [DRAW, FIT]
    assert (folder / RECORDS / "fit/kuka/200um.json").is_file()


def test_of_a_log_elsewhere_no_record_is_kept(folder):
    write_job_record(str(folder / "x.log"), FIT)
    assert read_job_records() == [] and list(folder.iterdir()) == []


def test_a_file_leads_back_to_every_job_behind_it_and_to_no_other():
    records = [DRAW, OTHER, FIT, MEASURE]
    assert jobs_behind(["e"], records) == [MEASURE, FIT, DRAW]
    assert jobs_behind(["c"], records) == [MEASURE, FIT]


def test_a_file_that_no_record_is_of_is_refused():
    with pytest.raises(InputError, match=r"^settings: found no record in results/jobs of the job that made it; allowed: "):
        jobs_behind(["settings"], [FIT])


def test_a_job_has_a_name_of_its_own():
    assert FIT.name == "fit kuka"


def test_any_altered_character_of_a_record_is_found(folder):
    write_job_record("results/logs/fit.log", FIT)
    path = folder / RECORDS / "fit.json"
    written = path.read_text(encoding="utf-8")
    for place in range(0, len(written) - 1, 7):
        if written[place].isspace():
            continue
        path.write_text(written[:place] + chr(ord(written[place]) ^ 1) + written[place + 1 :], encoding="utf-8")
        with pytest.raises(InputError, match=r"^results/jobs/fit\.json: found no record of a job "):
            read_job_records()


@pytest.mark.parametrize("text", ["", "{", "{}", "[]", '{"inputs": 1, "outputs": []}'])
def test_a_damaged_record_is_refused_in_one_line(folder, text):
    write_job_record("results/logs/fit.log", FIT)
    (folder / RECORDS / "fit.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"^results/jobs/fit\.json: found no record of a job .*; allowed: .*$"):
        read_job_records()
