"""Whether the errors of the boards that a camera reads are noise or functions of the view.

The declared model of the FR3 is fitted to all images. The error of the board that each
image shows, without that of bad images, is then predicted from all other images by a
Gaussian process, once from the view (direction and range of the middle of the board, its
normal and its roll) and once from the joint angles. No function predicts noise. The length
and the noise of each process are those of a grid that predict best, so the shares are
slightly too large. `python benchmarks/camera_views.py`, in ten seconds.
"""

from functools import partial

import numpy as np
from common import ROBOTS, ROOT

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.fitting.cases import prepare_case
from elastocal.fitting.noise import estimate_noise, fit_declared_model
from elastocal.fitting.sensor_noise import compute_sensor_axes
from elastocal.loop.loading import read_described_campaign

FOLDER = ROOT / "data" / "measured" / "fr3_board"
NAMES = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z")
# Images that turn the board by more than this are bad: four standard deviations.
BAD_RAD = 0.01
# Length of the process in root mean squares of the inputs, and variance of the noise over
# that of the process; the last one is no process at all.
LENGTHS = (0.5, 0.7, 1.0, 2.0, 4.0, 8.0)
NOISES = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 1e6)


def read_errors():
    """Return errors of the board in the camera (M, 6), m and rad, about its own axes, what
    they move the camera by (M, 3, 6), and two sets of inputs (M, k): views and joints."""
    _, campaign = read_described_campaign(read_campaign_folder(FOLDER, ROBOTS))
    case = prepare_case(campaign, FOLDER.name)
    noise, _ = estimate_noise(case)
    fitted = fit_declared_model(case.model, case.observations, noise)
    observations = case.observations
    axes = compute_sensor_axes(fitted.model, fitted.estimate, observations)
    errors = np.linalg.solve(axes, fitted.residual[..., None])[..., 0]
    into_camera = observations.rotation.transpose(0, 2, 1)
    middle_m = fitted.model.shaped_noise.options["middle_m"] - observations.position
    sight = (into_camera @ middle_m[..., None])[..., 0]
    roll = np.arctan2(into_camera[:, 1, 0], into_camera[:, 0, 0])
    view = np.column_stack(
        [
            sight[:, :2] / sight[:, 2:],
            sight[:, 2],
            into_camera[:, :2, 2],
            np.cos(roll),
            np.sin(roll),
        ]
    )
    good = np.abs(errors[:, 3:]).max(axis=1) < BAD_RAD
    joints = observations.states.joint_angles[observations.state]
    return errors[good], axes[good, :3], {"view": view[good], "joints": joints[good]}


def leave_each_out(inputs, values):
    """Errors (M,) of values that are predicted from all others."""
    standardized = (inputs - inputs.mean(axis=0)) / inputs.std(axis=0)
    squares = ((standardized[:, None] - standardized) ** 2).mean(axis=2)
    centred = values - values.mean()
    best = centred
    for length in LENGTHS:
        process = np.exp(-0.5 * squares / length**2)
        for noise in NOISES:
            precision = np.linalg.inv(process + noise * np.eye(len(values)))
            left_out = precision @ centred / np.diag(precision)
            best = min(best, left_out, key=lambda errors: (errors**2).sum())
    return best


def measure_camera_mm(errors, moves_camera):
    """RMS distance of the camera from its place by errors of what it reads."""
    shift = (moves_camera @ errors[..., None])[..., 0]
    return 1e3 * np.sqrt((shift**2).sum(axis=1).mean())


def main():
    """Print what each number and the camera lack, as measured and as predicted."""
    errors, moves_camera, inputs = read_errors()
    print(f"{len(errors)} good images; RMS in mm and mrad; share that is predicted")
    left_out = {
        source: np.apply_along_axis(partial(leave_each_out, values), 0, errors)
        for source, values in inputs.items()
    }
    for number, name in enumerate(NAMES):
        rms = 1e3 * errors[:, number].std()
        print(f"{name}: {rms:.3f}", end="")
        for source in inputs:
            share = 1.0 - left_out[source][:, number].var() / errors[:, number].var()
            print(f", {share:.2f} by {source}", end="")
        print()
    print(f"camera: {measure_camera_mm(errors, moves_camera):.3f} mm")
    for source in inputs:
        rms_mm = measure_camera_mm(left_out[source], moves_camera)
        print(f"camera, left out, predicted by {source}: {rms_mm:.3f} mm")


if __name__ == "__main__":
    main()
