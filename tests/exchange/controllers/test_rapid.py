import numpy as np
from made_targets import ANGLES, made_targets, numbers

from elastocal.exchange.controllers import rapid


def test_every_target_is_a_jointtarget_and_a_move():
    text = rapid.program("go", made_targets(rapid))
    constants = [line for line in text.splitlines() if "CONST jointtarget" in line]
    assert all(line.endswith(",[9E9,9E9,9E9,9E9,9E9,9E9]];") for line in constants)
    np.testing.assert_allclose(np.radians([numbers(line) for line in constants]), ANGLES, atol=1e-8)
    assert [line.split()[1] for line in text.splitlines() if "MoveAbsJ" in line] == [f"target_{n}," for n in range(1, 5)]
    assert text.startswith("MODULE go\n") and text.endswith("  ENDPROC\nENDMODULE\n")


def test_a_rail_is_the_first_external_axis_in_millimetres():
    text = rapid.program("go", made_targets(rapid, rail=True))
    assert "],[250.000000,9E9,9E9,9E9,9E9,9E9]];" in text and "],[-1500.000000,9E9," in text
