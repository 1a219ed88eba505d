import numpy as np
from made_targets import ANGLES, made_targets, numbers

from elastocal.exchange.controllers import urscript


def test_every_target_is_a_movej_in_radians_to_a_nanoradian():
    lines = urscript.program("go", made_targets(urscript)).splitlines()
    assert lines[0] == "def go():" and lines[-1] == "end"
    moves = [line for line in lines if line.startswith("  movej([")]
    np.testing.assert_allclose([numbers(move)[:6] for move in moves], ANGLES, atol=1e-9)


def test_joints_stand_in_the_controllers_order_whatever_theirs_is():
    stated = "wrist3,wrist2,wrist1,elbow,shoulder,base"
    (first, *_) = [
        line for line in urscript.program("go", made_targets(urscript, stated=stated)).splitlines() if "movej" in line
    ]
    np.testing.assert_allclose(numbers(first)[:6], ANGLES[0, ::-1], atol=1e-9)
