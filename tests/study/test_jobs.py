"""Tables of the study: every column has a name of its own, a meaning, and a unit where
it has one; and what jobs share."""

from types import SimpleNamespace

import pytest

from elastocal.io.storage import Column, TableSchema, read_provenance, write_table
from elastocal.study.jobs import collect_provenance, read_frames, write_csvs
from elastocal.study.schemas import IDENTIFIED, SCHEMAS

ALL = [schema.for_joints(joints) for schema in SCHEMAS.values() for joints in (3, 7)]


@pytest.mark.parametrize(
    "schema", ALL, ids=lambda schema: f"{schema.name} of {len(schema.columns)} columns"
)
def test_columns_have_a_name_of_their_own_a_meaning_and_a_unit_but_for_shares_and_ratios(
    schema,
):
    names = [column.name for column in schema.columns]
    assert len(set(names)) == len(names) and all(
        column.meaning for column in schema.columns
    )
    without = {
        column.name
        for column in schema.columns
        if column.type.startswith("float") and not column.unit
    }
    assert without <= {"nonpositive_share", "relative_spread"}


@pytest.mark.parametrize("joints", [3, 7])
def test_there_is_one_column_for_each_joint(joints):
    assert [
        column.name
        for column in IDENTIFIED.for_joints(joints).columns
        if "compl" in column.name
    ][-1] == f"compliance_{joints}"


def test_a_job_keeps_a_table_with_its_origin_and_reads_those_of_all_robots(tmp_path):
    job = SimpleNamespace(
        params={"seed": 1, "step": "of no account"},
        wildcards={"robot": "arm"},
        output={},
    )
    columns = (
        Column("data_set", "int32", "", "number"),
        Column("mean_square", "float64", "m^2", "mean square error"),
    )
    schema = TableSchema("made", columns)
    write_table(
        tmp_path / "arm.parquet",
        schema,
        [{"data_set": [0, 1], "mean_square": [1.0, 4.0]}],
        collect_provenance(job),
    )
    assert read_provenance(tmp_path / "arm.parquet")["configuration"] == {"seed": 1}
    job = SimpleNamespace(
        params=SimpleNamespace(robots=["arm"]), output={"table": tmp_path / "table.csv"}
    )
    write_csvs(job, table=read_frames(job, [tmp_path / "arm.parquet"], schema)["arm"])
    assert (tmp_path / "table.csv").read_text(
        encoding="utf-8"
    ) == "data_set,mean_square\n0,1\n1,4\n"
