"""Components of displacements and wrenches, as all tables have them."""

from elastocal.mechanics.components import COMPONENTS, WRENCH


def test_a_force_and_the_displacement_along_it_have_the_same_index():
    for (moved, unit, moves), (load, load_unit, loads) in zip(
        COMPONENTS, WRENCH, strict=True
    ):
        assert (moved[0], load[0], unit, load_unit) in [
            ("d", "f", "m", "N"),
            ("r", "m", "rad", "N m"),
        ]
        assert moved[1] == load[1] == moves[-1] == loads[-1]
