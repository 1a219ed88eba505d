"""What has finished beside study and loop."""

import hashlib

from planted_errors import forge

from elastocal_proof.audit.targets import OTHERS, finished


def test_a_target_has_finished_where_its_last_file_is_there_with_its_record(tmp_path):
    assert finished(tmp_path) == {}
    for target in ("blind", "planning"):
        (tmp_path / OTHERS[target]).parent.mkdir(parents=True)
        (tmp_path / OTHERS[target]).write_text("", encoding="utf-8")
        forge(tmp_path, OTHERS[target])
    # A table that was deleted is as good as none.
    (tmp_path / OTHERS["planning"]).unlink()
    assert finished(tmp_path) == {"blind": hashlib.sha256(b"").hexdigest()}
