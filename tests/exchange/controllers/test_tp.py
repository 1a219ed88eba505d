import numpy as np
from made_targets import ANGLES, RAIL, made_targets, numbers

from elastocal.exchange.controllers import tp


def positions(text):
    return [block.split("};")[0] for block in text.split("/POS\n")[1].split("P[")[1:]]


def test_every_target_is_a_position_of_joints_in_degrees():
    text = tp.program("go_2", made_targets(tp))
    assert text.startswith("/PROG  GO_2\n/ATTR\n") and text.endswith("};\n/END\n")
    assert [line for line in text.splitlines() if ":J P[" in line][2] == "   3:J P[3] 10% FINE    ;"
    found = positions(text)
    assert len(found) == 4 and all(block.count(" deg") == 6 and "J6= " in block for block in found)
    np.testing.assert_allclose(np.radians([numbers(block) for block in found]), ANGLES, atol=1e-8)


def test_a_rail_is_the_extended_axis_behind_the_joints_in_millimetres():
    found = positions(tp.program("go", made_targets(tp, rail=True)))
    assert all(",\n\tE1= " in block and block.rstrip().endswith(" mm") for block in found)
    np.testing.assert_allclose([numbers(block)[-1] for block in found], 1e3 * RAIL[:, 0])
