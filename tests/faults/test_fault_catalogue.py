"""Faults are looked for by the modules of the package, each behind those that make it meaningless."""

from elastocal.faults.catalogue import fault_modules, known_faults


def test_every_fault_of_the_design_is_there_and_of_family_data():
    assert known_faults() == {
        "constant_columns",
        "implausible_readings",
        "outliers",
        "shuffled_rows",
        "swapped_axes",
        "wrong_frame",
        "wrong_sign",
        "wrong_target",
        "wrong_unit",
    }
    assert {module.FAMILY for module in fault_modules().values()} == {"data"}


def test_a_module_stands_behind_those_that_it_comes_after():
    order = list(fault_modules())
    for name, module in fault_modules().items():
        assert all(order.index(other) < order.index(name) for other in module.AFTER)
