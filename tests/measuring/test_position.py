"""The kind `position`: its derivatives."""

import numpy as np
from checked_kinds import check_derivatives

from elastocal.measuring.position import POSITION


def test_derivatives_are_those_of_the_residual():
    check_derivatives(POSITION, np.zeros(0), np.ones((4, 3)))
