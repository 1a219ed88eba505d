"""The ground truth of a case is read only from the file whose hash was published."""

import hashlib

import pytest

from elastocal.errors import InputError
from elastocal_proof.blind.ground_truth import load_ground_truth


@pytest.fixture
def sealed(tmp_path):
    files = []
    for name in ("case_b", "case_a"):
        files.append(tmp_path / f"{name}.json")
        files[-1].write_text(f'{{"campaign": "{name}"}}', encoding="utf-8")
    lines = [f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in files]
    (tmp_path / "manifest.sha256").write_text("".join(lines), encoding="utf-8")
    return files, tmp_path / "manifest.sha256"


def test_ground_truths_come_by_the_names_of_their_cases(sealed):
    assert load_ground_truth(*sealed) == {name: {"campaign": name} for name in ("case_a", "case_b")}
    assert list(load_ground_truth(*sealed)) == ["case_a", "case_b"]


def test_a_ground_truth_that_was_changed_or_not_published_is_refused(sealed, tmp_path):
    files, manifest = sealed
    files[0].write_text('{"campaign": "case_c"}', encoding="utf-8")
    with pytest.raises(InputError, match=r"case_b\.json.*as sealed"):
        load_ground_truth(files, manifest)
    (tmp_path / "case_d.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"case_d\.json"):
        load_ground_truth([tmp_path / "case_d.json"], manifest)
