import numpy as np
from made_targets import ANGLES, RAIL, made_targets, numbers

from elastocal.exchange.controllers import krl


def test_every_target_is_a_ptp_in_degrees():
    lines = krl.program("go", made_targets(krl)).splitlines()
    assert lines[1] == "DEF go()" and lines[-1] == "END"
    moves = [line for line in lines if "PTP" in line]
    assert moves[0].startswith("  PTP {E6AXIS: A1 ") and all(move.count(" A") == 6 and move.endswith("}") for move in moves)
    np.testing.assert_allclose(np.radians([numbers(move) for move in moves]), ANGLES, atol=1e-8)


def test_a_rail_is_e1_in_millimetres():
    moves = [line for line in krl.program("go", made_targets(krl, rail=True)).splitlines() if "PTP" in line]
    assert all("{E6AXIS: E1 " in move for move in moves)
    np.testing.assert_allclose([numbers(move)[0] for move in moves], 1e3 * RAIL[:, 0])
