"""A catalogue finds the modules beside it, those that have what it asks for."""

import elastocal.io
from elastocal.io.modules import module_names, modules_with


def test_modules_are_found_by_what_they_have_in_the_order_of_their_names():
    names = module_names(elastocal.io)
    assert names == sorted(names) and {"modules", "storage", "texts"} <= set(names)
    found = modules_with("read_json", elastocal.io)
    assert list(found) == ["json_files", "records"] and found["json_files"].read_json
