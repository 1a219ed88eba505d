"""Joint targets for controller programs, and the numbers in such programs."""

import re

import numpy as np

from elastocal.exchange.controllers import build_targets, find_axes

ANGLES = np.random.default_rng(6).uniform(-3, 3, (4, 6))
RAIL = np.array([[0.25], [-1.5], [0.0], [3.125]])


def make_targets(controller, *, rail=False, stated=""):
    """Make four targets of six axes, which follow a rail if `rail`."""
    angles = np.hstack([RAIL, ANGLES]) if rail else ANGLES
    prismatic = (True,) * rail + (False,) * 6
    return build_targets(angles, prismatic, find_axes(controller, prismatic, stated))


def numbers(text):
    """Return all decimal numbers of a text."""
    return [float(number) for number in re.findall(r"-?\d+\.\d+", text)]
