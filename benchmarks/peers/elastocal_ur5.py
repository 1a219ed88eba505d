"""Calibrate the UR5 with elastocal: the geometry, then what the diagnosis finds."""

import elastocal as ec

from measured_job import URDF, Job, load_job, print_result


def predict(job: Job) -> ec.DiagnosisResult:
    """Diagnose; the result has the errors at the held-out poses, which `run.py` has drawn
    in the same way."""
    robot = ec.read_robot(URDF, base="base_link", tip="tool0")
    noise = {"position_m": 15e-6}
    campaign = ec.Campaign(
        robot, joint_angles=job.all_q, positions=job.all_x, noise=noise
    )
    return ec.diagnose(campaign)


if __name__ == "__main__":
    result = predict(load_job())
    models = {row["step"]: row for row in result.errors.to_dict("records")}
    *_, effects = models.values()
    print_result(
        {
            "geometry": models["declared model"],
            "effects": effects,
            "delivered": {
                "heldout_rms_m": result.after.rms_m,
                "heldout_max_m": result.after.max_m,
            },
        }
    )
