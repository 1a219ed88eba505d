"""A catalogue finds the modules beside it."""

import elastocal.io
from elastocal.io.modules import module_names


def test_modules_are_found_in_the_order_of_their_names():
    names = module_names(elastocal.io)
    assert names == sorted(names) and {"modules", "storage", "texts"} <= set(names)
