"""Columns of the loop's tables: their names, their units, and what may be missing in them."""

import numpy as np
import pytest
from made_loop_tables import candidate_table, confounding_table, residual_table
from support import refused

from elastocal.io.storage import TableSchema, read_table, write_table
from elastocal.loop import schemas

FIXED = [value for value in vars(schemas).values() if isinstance(value, TableSchema)]
OF_JOINTS = (schemas.measurements, schemas.residuals)


def units(schema):
    return {column.name: column.unit for column in schema.columns}


@pytest.mark.parametrize("schema", [*FIXED, *(of(7) for of in OF_JOINTS)], ids=lambda schema: schema.name)
def test_no_table_has_two_columns_of_one_name_and_each_says_what_it_holds(schema):
    names = [column.name for column in schema.columns]
    assert len(set(names)) == len(names)
    assert all(column.meaning.strip() for column in schema.columns)


@pytest.mark.parametrize("of", OF_JOINTS)
@pytest.mark.parametrize("joints", [3, 7])
def test_every_joint_has_its_angle_in_radians_and_no_other_joint_is_there(of, joints):
    angles = {name: unit for name, unit in units(of(joints)).items() if name.startswith("q")}
    assert angles == {f"q{joint}": "rad" for joint in range(1, joints + 1)}


def test_measurements_and_residuals_are_in_metres_radians_newtons_and_seconds():
    measured, left = units(schemas.measurements(6)), units(schemas.residuals(6))
    for table in (measured, left):
        assert [table[name] for name in ("x", "y", "z", "fx", "mz", "time_s")] == ["m", "m", "m", "N", "N m", "s"]
    assert [measured[name] for name in ("rx", "temperature_c", "approach6")] == ["rad", "°C", ""]
    for stage in ("before", "after"):
        assert {left[f"{stage}_d{axis}"] for axis in "xyz"} == {"m"}
        assert {left[f"{stage}_r{axis}"] for axis in "xyz"} == {"rad"}


def test_only_what_a_campaign_need_not_record_may_be_missing():
    missing = {column.name for column in schemas.measurements(2).columns if column.missing}
    assert missing == {"rx", "ry", "rz", "approach1", "approach2", "time_s", "temperature_c", "u95_m"}
    missing = {column.name for column in schemas.residuals(2).columns if column.missing}
    assert missing == {"time_s"} | {f"{s}_{part}{axis}" for s in ("before", "after") for part in "dr" for axis in "xyz"}


def test_a_made_table_of_residuals_fits_its_schema_and_a_position_that_is_missing_is_refused(tmp_path):
    table = residual_table(poses=3, timed=False)
    write_table(tmp_path / "r.parquet", schemas.residuals(6), [table], {})
    back = read_table(tmp_path / "r.parquet", schemas.residuals(6))
    np.testing.assert_array_equal(back["before_dz"], table["before_dz"])
    assert np.isnan(back["time_s"]).all()
    with refused(tmp_path / "w.parquet", "column x, "):
        write_table(tmp_path / "w.parquet", schemas.residuals(6), [table | {"x": np.full(len(table["x"]), np.nan)}], {})


@pytest.mark.parametrize("column, wrong", [("row", 0), ("target", -1)])
def test_rows_count_from_one_and_targets_from_zero(tmp_path, column, wrong):
    table = residual_table(poses=1)
    table[column] = np.full(len(table[column]), wrong)
    with refused(tmp_path / "r.parquet", column):
        write_table(tmp_path / "r.parquet", schemas.residuals(6), [table], {})


def test_candidates_that_could_not_be_tested_have_no_figures_and_yet_a_place(tmp_path):
    candidates = candidate_table(4, 2)
    write_table(tmp_path / "c.parquet", schemas.CANDIDATES, [candidates], {})
    back = read_table(tmp_path / "c.parquet", schemas.CANDIDATES)
    assert np.isnan(back["log_bayes_factor"]).tolist() == [False] * 4 + [True] * 2
    pairs = confounding_table(candidates)
    write_table(tmp_path / "p.parquet", schemas.CONFOUNDING, [pairs], {})
    assert len(read_table(tmp_path / "p.parquet", schemas.CONFOUNDING)["angle_deg"]) == 6
