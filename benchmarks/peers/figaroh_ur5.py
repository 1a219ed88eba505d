"""Calibrate the UR5 with FIGAROH: its base parameters, base and tip frames."""

import os
from pathlib import Path

import numpy as np

from measured_job import FOLDER, URDF, VARIABLE, Job, run


def predict(job: Job) -> np.ndarray:
    """Calibrate, and predict the positions (H, 3) at the held-out poses, m."""
    import pandas as pd
    from figaroh.calibration import BaseCalibration
    from figaroh.calibration.calibration_tools import calc_updated_fkm
    from figaroh.tools.robot import load_robot

    columns = ["x1", "y1", "z1", *(f"joint_{number}" for number in range(1, 7))]
    table = pd.DataFrame(np.hstack([job.x, job.q]), columns=columns)
    table.to_csv("figaroh_fitted.csv", index=False)

    class Calibration(BaseCalibration):
        def cost_function(self, var: np.ndarray) -> np.ndarray:
            return self.PEE_measured - self.compute(var, self.q_measured)

        def compute(self, var: np.ndarray, q: np.ndarray) -> np.ndarray:
            return calc_updated_fkm(self.model, self.data, var, q, self.calib_config)

    robot = load_robot(URDF, load_by_urdf=True)
    calibration = Calibration(robot, str(FOLDER / "figaroh.yaml"))
    calibration.calib_config["known_baseframe"] = False
    calibration.calib_config["known_tipframe"] = False
    calibration.initialize()
    solution = calibration.solve(enable_logging=False)
    calibration.calib_config["NbSample"] = len(job.held_out_q)
    return calibration.compute(solution.x, job.held_out_q).reshape(3, -1).T


if __name__ == "__main__":
    # It reads the measurements from a file.
    os.chdir(Path(os.environ[VARIABLE]).parent)
    run(predict)
