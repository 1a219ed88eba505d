"""The faults are the modules of the package, each behind those that make it meaningless."""

from elastocal.faults.catalogue import known_faults


def test_every_fault_of_the_design_is_there_and_of_family_data():
    assert set(known_faults()) == {"wrong_unit", "wrong_sign", "shuffled_rows", "outliers"}
    assert {module.FAMILY for module in known_faults().values()} == {"data"}


def test_a_fault_stands_behind_those_that_it_comes_after():
    order = list(known_faults())
    for name, module in known_faults().items():
        assert all(order.index(other) < order.index(name) for other in module.AFTER)
