"""The whole audit of a folder."""

from made_audits import CONFIGURATION
from planted_errors import forge
from support import refused

from elastocal.audit.audited import Audited
from elastocal.audit.findings import Finding
from elastocal.audit.whole import as_table, audit, require_all


def test_an_empty_folder_is_no_finished_run(tmp_path):
    assert [finding.holds for finding in audit(Audited(tmp_path, CONFIGURATION, {}, {}, 4))] == [False]


def test_a_file_that_cannot_be_read_is_a_finding_and_no_traceback(tmp_path):
    file = "results/budget/kuka.parquet"
    for folder in ("results/budget", "results/checksums/results/budget"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / file).write_bytes(b"no table")
    forge(tmp_path, file)
    found = audit(Audited(tmp_path, CONFIGURATION, {}, {}, 4))
    assert [finding.holds for finding in found] == [True, False, False]
    assert "ArrowInvalid" in found[1].note


def test_a_run_of_which_a_check_does_not_hold_is_refused_by_the_file():
    rows = [Finding("a.csv", "rows", "pandas", 1, 0.0), Finding("b.csv", "column x", "pandas", 3, 2.0, "found 1")]
    with refused("b.csv", "column x", "1 of 2 checks"):
        require_all(as_table(rows), "audit.html")
    assert require_all(as_table(rows[:1]), "audit.html") == "1 files, 1 checks, 1 values compared: all hold\n"
