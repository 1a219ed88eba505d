"""Placements take up what a motion of the base or a constant offset makes, and nothing
else."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from elastocal.application.frames import (
    BASE,
    ROBOT,
    Scope,
    root_mean_square,
    subtract_placement,
)

RNG = np.random.default_rng(2)
POSITION = RNG.standard_normal((50, 3))
ROTATION = Rotation.random(50, rng=RNG).as_matrix()
BASE_MOVED = 1e-4 * np.cross([0.3, -0.2, 0.5], POSITION) + [1e-3, 2e-3, -1e-3]
FIELDS = {
    "base": BASE_MOVED,
    "offset": ROTATION @ [1e-3, 0.0, 2e-3],
    "stretched": POSITION * [1e-3, 0, 0],
}


@pytest.mark.parametrize("frame", [BASE, ROBOT])
@pytest.mark.parametrize("offset", [False, True])
@pytest.mark.parametrize("name", FIELDS)
def test_each_freedom_takes_up_its_own_motion(frame, offset, name):
    scope = Scope(frame, POSITION.mean(axis=0), offset_removed=offset)
    field = np.concatenate([FIELDS[name], np.zeros((50, 3))], axis=1)[..., None]
    left = root_mean_square(
        subtract_placement(scope, POSITION, ROTATION, field)[:, :3, 0]
    )
    taken_up = {"base": frame == ROBOT, "offset": offset, "stretched": False}[name]
    assert left < 1e-12 if taken_up else left > 1e-4
