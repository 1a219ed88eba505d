"""Schemas are found by the name that a file has for itself."""

from elastocal.study.table_schemas import identified
from elastocal_proof.audit.schemas import SCHEMAS
from elastocal_proof.blind.schemas import BAD_ROWS, closed_loop


def test_tables_of_study_loop_league_and_proof_are_known():
    known = {"experiments", "deflections", "identified", "metrics", "budget", "measurements", "models", "entries"}
    assert {*known, "closed_loop", "bad_rows"} <= set(SCHEMAS)


def test_a_schema_has_as_many_columns_as_the_robot_joints():
    assert SCHEMAS["identified"](7) == identified(7)
    assert SCHEMAS["closed_loop"](7) == closed_loop(7)
    assert SCHEMAS["bad_rows"](7) == BAD_ROWS
