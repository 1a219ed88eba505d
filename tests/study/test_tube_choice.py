"""The tube that makes one figure of the paper come out."""

from dataclasses import replace

import numpy as np
import pytest
from support import random_loads

from elastocal.mechanics.links import with_tube
from elastocal.study.simulation import true_deflections
from elastocal.study.tube_choice import diameter_for_mean_deflection


def test_diameter_is_found_back_from_the_mean_that_it_causes(kuka_extended):
    loads, tube = random_loads(kuka_extended, 1, 20), kuka_extended.links[0].tube
    for diameter in (0.18, 0.31):
        robot = with_tube(kuka_extended, replace(tube, outer_diameter_m=diameter))
        deflection = true_deflections(robot, loads, robot.chain.end_effector, "end_effector")
        mean = np.linalg.norm(deflection[..., :3], axis=-1).mean()
        # The search stops at a micrometre.
        assert diameter_for_mean_deflection(kuka_extended, loads, mean) == pytest.approx(diameter, abs=3e-6)
