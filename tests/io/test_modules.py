"""A catalogue finds the modules of its package."""

import elastocal.io
from elastocal.io.modules import list_modules


def test_modules_are_found_in_the_order_of_their_names():
    names = list_modules(elastocal.io)
    assert names == sorted(names) and {"modules", "storage", "texts"} <= set(names)
