"""One figure of the paper fixes the one free size of the extended robot's tubes (interpretation R11)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from elastocal.mechanics.links import with_tube
from elastocal.study.simulation import true_deflections

if TYPE_CHECKING:
    from elastocal.mechanics.robot import Robot
    from elastocal.study.experiments import Experiments


def diameter_for_mean_deflection(
    robot: Robot, experiments: Experiments, target_m: float, between_m: tuple[float, float] = (0.1, 0.8)
) -> float:
    """Outer diameter of the tubes, at the wall that they have, for which the mean end-effector deflection comes out.

    By Brent's method [1].

    `robot`: with links, all of one tube. `target_m`: mean over the experiments of the norm of the displacement, m. `between_m`:
    diameters to search. Returns m.

    [1] Brent, R. P., Algorithms for Minimization without Derivatives, Prentice-Hall, 1973.
    """

    def excess(diameter: float) -> float:
        candidate = with_tube(robot, replace(robot.links[0].tube, outer_diameter_m=diameter))
        deflections = true_deflections(candidate, experiments, robot.chain.end_effector, "end_effector")
        return np.linalg.norm(deflections[..., :3], axis=-1).mean() - target_m

    return brentq(excess, *between_m, xtol=1e-6)
