"""What has finished beside study and loop."""

from elastocal.audit.targets import OTHERS, finished


def test_a_target_has_finished_where_its_last_file_is_there_with_its_record(tmp_path):
    assert finished(tmp_path) == {}
    for target in ("blind", "planning"):
        record = tmp_path / f"results/checksums/{OTHERS[target]}.sha256"
        record.parent.mkdir(parents=True)
        record.write_text(f"abc  {OTHERS[target]}\n", encoding="utf-8")
    # A table that was deleted is as good as none.
    (tmp_path / "reports/blind").mkdir(parents=True)
    (tmp_path / OTHERS["blind"]).write_text("", encoding="utf-8")
    assert finished(tmp_path) == {"blind": "abc"}
