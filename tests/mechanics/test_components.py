"""Components of displacements and wrenches, as all tables have them."""

from elastocal.campaigns.measurements import describe_columns
from elastocal.mechanics.components import COMPONENTS, WRENCH_NAMES


def test_a_force_and_the_displacement_along_it_have_the_same_index():
    columns = describe_columns(6)
    for (moved, unit, moves), load in zip(COMPONENTS, WRENCH_NAMES, strict=True):
        assert (moved[0], load[0], unit, columns[load].unit) in [
            ("d", "f", "m", "N"),
            ("r", "m", "rad", "N m"),
        ]
        assert moved[1] == load[1] == moves[-1]
        assert f" {load[1]}," in columns[load].meaning
