"""Find the tube diameter that gives kuka_extended the mean deflection of Table 2.

Run once by hand, from the top of the repository: python
workflow/searches/choose_tube.py. The result, rounded to 0.1 mm, is in
config/robots/kuka_extended.yaml; the choice used no other figure of the paper.
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from elastocal.io.documents import read_document
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import parse_robot
from elastocal.study.simulation import (
    Experiments,
    Loading,
    RandomDesign,
    compute_true_deflections,
    draw_random_experiments,
)

TABLE_2_MEAN_M = 1.749e-3


def diameter_for_mean_deflection(
    robot: Robot, experiments: Experiments, target_m: float
) -> float:
    """Find the tube diameter for a mean end-effector deflection by Brent's method.

    One figure of the paper fixes this only free size of the extended robot
    (interpretation R11).

    Parameters
    ----------
    robot : Robot
        Its links all have the same tube, whose wall stays as it is.
    experiments : Experiments
        Joint angles and wrenches.
    target_m : float
        Mean over the experiments of the norm of the displacement, m.

    Returns
    -------
    float
        Outer diameter, m.
    """

    def excess(diameter: float) -> float:
        tube = replace(robot.links[0].tube, outer_diameter_m=diameter)
        candidate = replace(
            robot, links=tuple(replace(link, tube=tube) for link in robot.links)
        )
        deflections = compute_true_deflections(
            candidate, experiments, robot.chain.end_effector, "end_effector"
        )
        return np.linalg.norm(deflections[..., :3], axis=-1).mean() - target_m

    return brentq(excess, 0.1, 0.8, xtol=1e-6)


if __name__ == "__main__":
    config = read_document("config.yaml")
    robot = parse_robot(read_document("config/robots/kuka_extended.yaml"))
    measurements = {
        key: config["interpretations"][key] for key in ("offset_frame", "joint_range")
    }
    loading = Loading(**config["loading"], **measurements)
    experiments = draw_random_experiments(
        RandomDesign(robot.chain, robot.joint_limits, loading, "kuka_extended"),
        config["seed"],
        "identification",
        range(config["data_sets"]),
        config["configurations"],
    )
    diameter = diameter_for_mean_deflection(robot, experiments, TABLE_2_MEAN_M)
    print(f"outer_diameter_m: {diameter:.4f} at wall_m: {robot.links[0].tube.wall_m}")
