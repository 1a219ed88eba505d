"""A placement absorbs motions of the base or a constant offset, and nothing else."""

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

STREAM = np.random.default_rng(2)
POSITION = STREAM.standard_normal((50, 3))
ROTATION = Rotation.random(50, rng=STREAM).as_matrix()
DISPLACEMENTS = {
    "base": 1e-4 * np.cross([0.3, -0.2, 0.5], POSITION) + [1e-3, 2e-3, -1e-3],
    "offset": ROTATION @ [1e-3, 0.0, 2e-3],
    "stretched": POSITION * [1e-3, 0, 0],
}


@pytest.mark.parametrize("frame", [BASE, ROBOT])
@pytest.mark.parametrize("offset_removed", [False, True])
@pytest.mark.parametrize("name", DISPLACEMENTS)
def test_each_degree_of_freedom_absorbs_its_own_motion(frame, offset_removed, name):
    scope = Scope(frame, POSITION.mean(axis=0), offset_removed=offset_removed)
    field = np.concatenate([DISPLACEMENTS[name], np.zeros((50, 3))], axis=1)[..., None]
    residual = subtract_placement(scope, POSITION, ROTATION, field)
    residual_m = root_mean_square(residual[:, :3, 0])
    absorbed = {"base": frame == ROBOT, "offset": offset_removed, "stretched": False}
    if absorbed[name]:
        assert residual_m < 1e-12
    else:
        assert residual_m > 1e-4
