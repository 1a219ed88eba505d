"""Schemas are found by the name that a file has for itself."""

from elastocal.study.table_schemas import identified
from elastocal_proof.audit.schemas import SCHEMAS


def test_tables_of_study_and_loop_are_known():
    assert {"experiments", "deflections", "identified", "metrics", "budget", "measurements", "models"} <= set(SCHEMAS)


def test_a_schema_has_as_many_columns_as_the_robot_joints():
    assert SCHEMAS["identified"](7) == identified(7)
