"""Calibrate the UR5 with robotkinecal: a product of exponentials."""

import numpy as np

from measured_job import URDF, Job, run


def predict(job: Job) -> np.ndarray:
    """Calibrate, and predict the positions (H, 3) at the held-out poses, m."""
    import roboticstoolbox as rtb
    from robotkinecal.calibration import SerialRobotKineCal

    robot = rtb.Robot.URDF(URDF)
    calibration = SerialRobotKineCal(robot, ee_name="tool0")
    calibration.set_observations([*job.q], [*job.x])
    calibration.solve()
    poses = [calibration.forward_kinematics(7, angles) for angles in job.held_out_q]
    return np.array([pose.t for pose in poses])


if __name__ == "__main__":
    run(predict)
