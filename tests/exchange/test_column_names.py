"""Columns are known by what they are usually called, with their units."""

import math

import pytest

from elastocal.exchange.column_names import is_name, kind_of, recognize_column, unit_scale, units_of


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("q1", "q1", None),
        ("J3 [deg]", "q3", "deg"),
        ("Joint 4 (rad)", "q4", "rad"),
        ("A6", "q6", None),
        ("Axis_2_deg", "q2", "deg"),
        ("X", "x", None),
        ("x_mm", "x", "mm"),
        ("Position Y [mm]", "y", "mm"),
        ("Yaw (°)", "rz", "°"),
        ("Force X [kN]", "fx", "kN"),
        ("mz [N m]", "mz", "Nm"),
        ("mx (N·mm)", "mx", "Nmm"),
        ("Time [ms]", "time_s", "ms"),
        ("time_s", "time_s", "s"),
        ("Temperature [°C]", "temperature_c", "°C"),
        ("SMR", "target", None),
        ("t14", "t14", None),
        ("approach5", "approach5", None),
        # Whose first joint 0 is, and what an operator is, an option has to say.
        ("q0", None, None),
        ("Operator", None, None),
        ("tx", None, None),
        # No arm has so many joints, and each up to the last would be looked for.
        ("q999999999", None, None),
        ("q" + "9" * 5000, None, None),
        ("q٣", None, None),
        ("x_furlong", None, None),
    ],
)
def test_headers_are_recognized(header, name, unit):
    assert recognize_column(header) == (name, unit)
    assert name is None or is_name(name)


def test_units_are_those_of_the_kind():
    assert unit_scale("mm", kind_of("x")) == 1e-3
    assert unit_scale("deg", kind_of("q1")) == math.pi / 180.0
    # Of a prismatic joint.
    assert unit_scale("mm", kind_of("q7")) == 1e-3
    assert unit_scale("deg", kind_of("x")) is None
    assert unit_scale("kgf", kind_of("fx")) == 9.80665
    assert "mm" in units_of(kind_of("q2")) and "mm" not in units_of(kind_of("rx"))
