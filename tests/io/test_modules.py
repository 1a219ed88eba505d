"""A catalogue finds the modules of its package."""

import elastocal.io
import elastocal.measuring
from elastocal.io.modules import list_entries, list_modules
from elastocal.measuring.protocol import Kind


def test_modules_are_found_in_the_order_of_their_names():
    names = list_modules(elastocal.io)
    assert names == sorted(names) and {"modules", "storage", "texts"} <= set(names)


def test_each_object_of_a_class_is_listed_once_whoever_imports_it():
    names = [kind.name for kind in list_entries(elastocal.measuring, Kind)]
    assert len(names) == len({*names}) and {"board", "plane", "point"} <= {*names}
