"""Masses that come without an uncertainty: a drawing's or a guess, and a maker's table."""

from elastocal.exchange.mass_deviations import OF_TABLE, OF_URDF


def test_a_table_is_trusted_more_than_a_urdf_and_neither_beyond_what_masses_are_known_to():
    assert 0.1 <= OF_TABLE < OF_URDF <= 1 / 3
