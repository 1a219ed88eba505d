"""Calibrate the UR5 with pybotics: all modified Denavit-Hartenberg parameters, base and
tool, by scipy's least squares on its fitness function."""

import numpy as np

from measured_job import Job, run


def predict(job: Job) -> np.ndarray:
    """Calibrate, and predict the positions (H, 3) at the held-out poses, m."""
    from pybotics.optimization import OptimizationHandler, optimize_accuracy
    from pybotics.robot import Robot
    from scipy.optimize import least_squares

    rows = [
        [0, 0, 0, 89.159],
        [np.pi / 2, 0, 0, 0],
        [0, -425, 0, 0],
        [0, -392.25, 0, 109.15],
        [np.pi / 2, 0, 0, 94.65],
        [-np.pi / 2, 0, 0, 82.3],
    ]
    robot = Robot.from_parameters(np.array(rows))
    tool = [True, True, True, False, False, False]
    handler = OptimizationHandler(robot, True, tool, True)  # noqa: FBT003 - its interface
    start = handler.generate_optimization_vector()
    least_squares(optimize_accuracy, start, args=(handler, job.q, 1e3 * job.x))
    return np.array(
        [1e-3 * handler.robot.fk(angles)[:3, 3] for angles in job.held_out_q]
    )


if __name__ == "__main__":
    run(predict)
