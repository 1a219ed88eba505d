"""
First calibration from arrays
=============================

Five lines lead from joint angles and positions in memory to a corrected robot. The
measurements are real: a laser tracker measured a UR5 in 143 poses (P. Jacobi, MIT
licence, see the page on the measured data in the box).
"""

# %%
# The file has wanted positions and differences from them in mm, and joint angles in
# degrees. elastocal takes metres and radians everywhere.
import matplotlib.pyplot as plt
import numpy as np

import elastocal as ec
from elastocal.command.terminal import find_pipeline

files = find_pipeline()  # the checkout, or the files that the wheel has installed
MEASURED = "data/measured/jacobi_ur5/3D_UR5_uncalibrated_grid_every_seventh.csv"
table = np.loadtxt(files / MEASURED, delimiter=",", skiprows=1)
x = 1e-3 * (table[:, 1:4] + table[:, 4:7])
q = np.radians(table[:, 7:13])

# %%
# Calibrate. The maker of the tracker states a noise of 15 µm. The base of the robot in
# the tracker's frame and the place of the reflector on the flange are unknown, which is
# the default.
robot = ec.read_robot(files / "config/robots/ur5.yaml")
campaign = ec.Campaign(robot, joint_angles=q, positions=x, noise={"position_m": 15e-6})
result = ec.diagnose(campaign)
print(result)

# %%
# The errors are those at 43 poses that no step of the calibration has seen. *Frames and
# targets* is the robot as its controller believes it to be, *declared model* adds the
# calibrated geometry, and the last model adds what the diagnosis has found.
for step, rms_m in zip(
    result.errors["step"], result.errors["heldout_rms_m"], strict=True
):
    print(f"{1e3 * rms_m:.3f} mm  {step}")

# %%
# The corrected robot predicts the error that remains at any configuration, with a bound
# that holds with a probability of 95 %.
prediction = result.robot.predict_errors(q)
print(f"{1e3 * prediction.error_m.mean():.3f} mm on average")
print(f"{1e3 * prediction.bound_m.max():.3f} mm bound at the worst configuration")

# %%
# Figures draw on given axes, here the RMS error of each model at the poses that it has not
# seen, with its 95 % interval. Diamonds are the errors at the fitted poses, the dotted
# line is the noise of the tracker.
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
result.plot.errors(axes)
plt.show()
