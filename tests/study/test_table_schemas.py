"""Tables: every column has a name of its own, a meaning, and a unit where it has one."""

import pytest

from elastocal.io.storage import TableSchema
from elastocal.study import table_schemas

SCHEMAS = [schema for schema in vars(table_schemas).values() if isinstance(schema, TableSchema)]
SCHEMAS += [make(n) for make in (table_schemas.experiments, table_schemas.identified) for n in (3, 6, 7)]
SCHEMAS += [make(n) for make in (table_schemas.metrics, table_schemas.accuracy) for n in (3, 6, 7)]


@pytest.mark.parametrize("schema", SCHEMAS, ids=lambda schema: f"{schema.name} of {len(schema.columns)} columns")
def test_columns_have_a_name_of_their_own_and_a_meaning(schema):
    names = [column.name for column in schema.columns]
    assert len(set(names)) == len(names)
    assert all(column.meaning for column in schema.columns)


@pytest.mark.parametrize("make", ["experiments", "identified", "metrics", "accuracy"])
def test_only_shares_and_ratios_go_without_a_unit(make):
    columns = [*getattr(table_schemas, make)(6).columns, *table_schemas.DEFLECTIONS.columns, *table_schemas.BOUNDS.columns]
    without = {column.name for column in columns if column.type.startswith("float") and not column.unit}
    assert without <= {"condition", "nonpositive_share", "relative_spread"}


def test_there_is_one_column_for_each_joint_and_one_covariance_for_each_pair():
    for joints in (3, 7):
        assert {f"c{j + 1}" for j in range(joints)} <= {column.name for column in table_schemas.identified(joints).columns}
        names = {column.name for column in table_schemas.design(joints).columns}
        pairs = table_schemas.covariance_columns(joints)
        assert len(pairs) == joints * (joints + 1) // 2 and {name for name, _, _ in pairs} <= names
        assert {(i, j) for _, i, j in pairs} == {(i, j) for i in range(joints) for j in range(i + 1)}


def test_schema_finds_its_columns_by_name():
    assert table_schemas.experiments(6).column("q3").unit == "rad"
    assert table_schemas.DEFLECTIONS.column("rx").unit == "rad"
    assert table_schemas.experiments(6).column("mx").unit == "N m"
