"""Calibrate a measured UR5 from arrays with the base requirements alone.

Usage: python workflow/examples/five_lines.py, from the top of the repository. `make
installed` and tests/project/test_wheel.py run it where nothing else is installed.
"""

from importlib.util import find_spec

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

import elastocal as ec
from elastocal.errors import EXTRAS

# Measurements in the box, see data/measured/README.md: wanted positions and differences
# from them, mm, and joint angles, degrees.
MEASURED = "data/measured/jacobi_ur5/3D_UR5_uncalibrated_grid_every_seventh.csv"
table = np.loadtxt(MEASURED, delimiter=",", skiprows=1)
x = 1e-3 * (table[:, 1:4] + table[:, 4:7])
q = np.radians(table[:, 7:13])


def tabulate_poses(robot: ec.CorrectedRobot, joint_angles: np.ndarray) -> pd.DataFrame:
    """Tabulate the poses that a robot reaches as a path in the same posture."""
    positions, rotations = robot.predict(joint_angles)
    turns = Rotation.from_matrix(rotations).as_rotvec()
    names = ["x", "y", "z", "rx", "ry", "rz", "q1", "q2", "q3", "q4", "q5", "q6"]
    return pd.DataFrame(np.hstack([positions, turns, joint_angles]), columns=names)


robot = ec.read_robot("config/robots/ur5.yaml")
campaign = ec.Campaign(robot, joint_angles=q, positions=x, noise={"position_m": 15e-6})
result = ec.diagnose(campaign)
path = tabulate_poses(result.robot, q[:3])
targets = result.robot.correct(path).table

print(result)
print(targets[["q1", "q2", "q3", "predicted_error_after_m"]])
print("not installed:", *(name for name in EXTRAS if find_spec(name) is None))
