"""Joint targets for programs of controllers, and numbers read back of such programs."""

import re

import numpy as np

from elastocal.exchange.controllers import build_targets, find_axes

ANGLES = np.random.default_rng(6).uniform(-3, 3, (4, 6))
RAIL = np.array([[0.25], [-1.5], [0.0], [3.125]])


def make_targets(controller, rail=False, stated=""):
    """Four targets of six axes, with `rail` on a rail before them."""
    angles = np.hstack([RAIL, ANGLES]) if rail else ANGLES
    prismatic = (True,) * rail + (False,) * 6
    return build_targets(angles, prismatic, find_axes(controller, prismatic, stated))


def numbers(text):
    return [float(word) for word in re.findall(r"-?\d+\.\d+", text)]
