"""Components of displacements and wrenches, as all tables have them."""

from elastocal.mechanics.components import (
    COMPONENT_NAMES,
    WRENCH_NAMES,
    list_joint_columns,
)
from elastocal.study.schemas import DEFLECTIONS, EXPERIMENTS


def test_a_force_and_the_displacement_along_it_have_the_same_index():
    columns = {
        column.name: column for column in (*DEFLECTIONS.columns, *EXPERIMENTS.columns)
    }
    for moved, load in zip(COMPONENT_NAMES, WRENCH_NAMES, strict=True):
        assert (moved[0], load[0], columns[moved].unit, columns[load].unit) in [
            ("d", "f", "m", "N"),
            ("r", "m", "rad", "N m"),
        ]
        assert moved[1] == load[1]
        for name in (moved, load):
            assert f"base {name[1]}," in columns[name].meaning


def test_quantities_of_joints_are_numbered_from_one():
    assert list_joint_columns(3) == ["q1", "q2", "q3"]
    assert list_joint_columns(2, "approach") == ["approach1", "approach2"]
