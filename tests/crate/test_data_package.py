"""The data package of the tables."""

import hashlib
from pathlib import Path

from elastocal.crate.data_package import data_package
from elastocal.io.origin import Origin
from elastocal.io.records import JobRecord


def test_each_csv_below_the_folder_has_its_columns_digest_and_origin(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("reports/tables").mkdir(parents=True)
    text = "robot,rms_um,count,holds\nkuka,1.5,3,True\n"
    Path("reports/tables/Table_1.csv").write_text(text)
    Path("reports/empty.csv").write_text("\n")
    outputs = ("reports/empty.csv", "reports/tables/Table_1.csv", "reports/tables/table1.md", "results/other.csv")
    job = JobRecord("tabulate", {}, "a", "b", {}, (), outputs, Origin("c0ffee", "d16e57", 7), {})
    empty, resource = data_package([job], "reports", "MIT")["resources"]
    assert empty["schema"]["fields"] == []
    assert (resource["path"], resource["name"]) == ("tables/Table_1.csv", "tables-table_1")
    assert resource["hash"] == f"sha256:{hashlib.sha256(text.encode()).hexdigest()}" and resource["bytes"] == len(text)
    assert [field["type"] for field in resource["schema"]["fields"]] == ["string", "number", "integer", "boolean"]
    assert resource["origin"] == {"commit": "c0ffee", "configuration_sha256": "d16e57", "seed": 7}
