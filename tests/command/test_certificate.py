import json

import pytest
from certified import certified_checkout
from typer.testing import CliRunner

from elastocal.command.main import app
from elastocal.errors import InputError


@pytest.fixture(scope="module")
def top(tmp_path_factory):
    found = tmp_path_factory.mktemp("certified")
    certified_checkout(found)
    certified_checkout(found, "later", 2e-3)
    return found


@pytest.fixture
def run(top, monkeypatch):
    monkeypatch.chdir(top)

    def called(*words):
        return CliRunner().invoke(app, ["certificate", *map(str, words)])

    return called


def test_pages_and_document_are_written_beside_the_report(run, top):
    result = run(top / "made", "--tolerance", "0.5mm", "--serial", "7", "--date", "2026-11-20")
    assert result.exit_code == 0, result.output
    reports = top / "reports" / "loop" / "made"
    assert (reports / "certificate.pdf").read_bytes().startswith(b"%PDF")
    document = json.loads((reports / "certificate.json").read_text())
    assert (document["serial"], document["date"]) == ("7", "2026-11-20")
    assert document["conformity"]["tolerance_m"] == 5e-4
    assert document["conformity"]["decision"] in result.output


def test_a_joint_that_slipped_between_two_campaigns_is_seen(run, top, tmp_path):
    result = run(top / "later", "--tolerance", "0.5mm", "--compare", top / "made", "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    comparison = json.loads((tmp_path / "out" / "certificate.json").read_text())["comparison"]
    assert comparison["p_value"] < 1e-3 and "moves differently than in made" in result.output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--tolerance", "0.5"], "0.2mm"),
        (["--tolerance", "0.5mm", "--compare", "nowhere"], "nowhere"),
        (["--tolerance", "0.5mm", "--date", "20 November"], "--date: found '20 November'; allowed: a date"),
        (["--tolerance", "0.5mm", "--serial", ""], "--serial: found ''; allowed: 1 to 60 characters"),
    ],
)
def test_bad_options_end_in_one_line_and_write_nothing(run, top, tmp_path, words, message):
    result = run(top / "made", *words, "--output", tmp_path / "out")
    assert isinstance(result.exception, InputError) and message in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_data_at_fault_get_no_certificate(run, top, tmp_path):
    path = top / "reports" / "loop" / "made" / "verdict.json"
    before = path.read_text()
    verdict = json.loads(before)
    verdict["effects"] = [{"family": "data", "name": "wrong_sign"}]
    path.write_text(json.dumps(verdict))
    try:
        result = run(top / "made", "--tolerance", "0.5mm", "--output", tmp_path / "out")
    finally:
        path.write_text(before)
    assert isinstance(result.exception, InputError) and "data at fault" in str(result.exception)


def test_a_campaign_without_a_report_is_refused(run, top, tmp_path):
    path = top / "reports" / "loop" / "made" / "before_after.csv"
    path.rename(tmp_path / "kept")
    try:
        result = run(top / "made", "--tolerance", "0.5mm", "--output", tmp_path / "out")
    finally:
        (tmp_path / "kept").rename(path)
    assert isinstance(result.exception, InputError) and "elastocal diagnose" in str(result.exception)
