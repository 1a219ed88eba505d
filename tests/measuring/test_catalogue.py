"""The catalogue finds the kinds of this package by itself."""

from elastocal.measuring.catalogue import list_bundled_kinds, list_kinds


def test_every_kind_of_the_package_is_found_and_says_what_it_measures():
    kinds = list_bundled_kinds()
    assert set(kinds) <= set(list_kinds())
    assert {"board", "distance", "line", "plane", "point", "pose"} <= set(kinds)
    for name, kind in kinds.items():
        assert kind.name == name
        assert kind.numbers in (1, 3, 6)
        assert kind.meaning
        assert kind.error != "residual"
