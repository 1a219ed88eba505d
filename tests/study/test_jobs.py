"""Tables of the study: every column has a name of its own, a meaning, and a unit where
it has one; and what jobs share."""

from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest

from elastocal import study
from elastocal.io.storage import TableSchema, read_provenance, write_table
from elastocal.study.equation_11 import make_identified_schema
from elastocal.study.evaluation import make_metrics_schema, make_repeated_schema
from elastocal.study.jobs import (
    DATA_SET,
    MEAN_SQUARE,
    collect_provenance,
    make_schema,
    read_frames,
    write_csvs,
)
from elastocal.study.simulation import make_experiments_schema

MODULES = [
    import_module(f"elastocal.study.{path.stem}")
    for path in Path(study.__file__).parent.glob("[a-z]*.py")
]
SCHEMAS = {
    value.name: value
    for module in MODULES
    for value in vars(module).values()
    if isinstance(value, TableSchema)
}
BY_JOINTS = (
    make_experiments_schema,
    make_identified_schema,
    make_metrics_schema,
    make_repeated_schema,
)
ALL = [*SCHEMAS.values(), *(make(joints) for make in BY_JOINTS for joints in (3, 7))]


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
        for column in make_identified_schema(joints).columns
        if "compl" in column.name
    ][-1] == f"compliance_{joints}"


def test_a_job_keeps_a_table_with_its_origin_and_reads_those_of_all_robots(tmp_path):
    job = SimpleNamespace(
        params={"seed": 1, "step": "of no account"},
        wildcards={"robot": "arm"},
        output={},
    )
    schema = make_schema("made", DATA_SET, MEAN_SQUARE)
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
