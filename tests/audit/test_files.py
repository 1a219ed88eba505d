"""What is asked of every file."""

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from made_audits import CONFIGURATION, ROBOT, failed
from planted_errors import forge

from elastocal.io.provenance import provenance
from elastocal.io.records import recorded
from elastocal.io.storage import write_table
from elastocal.study.table_schemas import INITIAL
from elastocal_proof.audit.audited import Audited
from elastocal_proof.audit.files import described, intact

FILE = "results/initial/two.parquet"


@pytest.fixture
def run(tmp_path):
    (tmp_path / "results/initial").mkdir(parents=True)
    return Audited(tmp_path, CONFIGURATION, {"two": ROBOT}, {}, 4)


def write(run, seed=1, robot="two"):
    block = {"data_set": [0], "configurations": [5], "mean": [1e-3], "mean_square": [1e-6], "maximum": [1e-3]}
    write_table(run.folder / FILE, INITIAL, [block], provenance({"seed": seed}, robot=robot))
    forge(run.folder, FILE)


def test_a_file_as_it_was_written_holds(run):
    write(run)
    assert recorded(run.folder).keys() == {FILE}
    assert intact(run, FILE, recorded(run.folder)[FILE]).holds
    assert failed(described(run, FILE)) == []


def test_an_altered_and_a_missing_file_are_found(run):
    write(run)
    digest = recorded(run.folder)[FILE]
    with open(run.folder / FILE, "ab") as file:
        file.write(b"x")
    assert not intact(run, FILE, digest).holds
    (run.folder / FILE).unlink()
    assert intact(run, FILE, digest).note == "it is missing"


def test_a_column_that_names_another_robot_is_found(run):
    write(run)
    facts = {key: value for key, value in pq.read_metadata(run.folder / FILE).metadata.items() if key != b"ARROW:schema"}
    table = pq.read_table(run.folder / FILE)
    other = table.set_column(0, table.schema.field("robot"), pa.array(["other"]).dictionary_encode())
    pq.write_table(other.replace_schema_metadata(facts), run.folder / FILE)
    assert failed(described(run, FILE)) == ["columns of what it is of"]


@pytest.mark.parametrize(
    ("change", "checked"), [({"seed": 2}, "made by what is configured"), ({"robot": "other"}, "made for where it lies")]
)
def test_a_file_of_another_run_or_robot_is_found(run, change, checked):
    write(run, **change)
    assert failed(described(run, FILE)) == [checked]
