"""
What a measured UR5 lacks
=========================

A calibrated geometry leaves 0.12 mm of this robot's position error. The diagnosis says
which physical effects cause the rest, how probable they are and how large.
"""

# %%
# The measurements of :doc:`first_calibration`.
import numpy as np
import pandas as pd

import elastocal as ec
from elastocal.command.terminal import find_pipeline

files = find_pipeline()  # the checkout, or the files that the wheel has installed
MEASURED = "data/measured/jacobi_ur5/3D_UR5_uncalibrated_grid_every_seventh.csv"
table = np.loadtxt(files / MEASURED, delimiter=",", skiprows=1)
x = 1e-3 * (table[:, 1:4] + table[:, 4:7])
q = np.radians(table[:, 7:13])
robot = ec.read_robot(files / "config/robots/ur5.yaml")
campaign = ec.Campaign(robot, joint_angles=q, positions=x, noise={"position_m": 15e-6})

# %%
# Before a diagnosis, a check says what the measurements identify. There are no loads, so
# nothing elastic can be named.
for heading, words in ec.check(campaign).rows:
    print(f"{heading:>15}  {words}")

# %%
# A notebook shows a result as its verdict, its errors and a figure.
result = ec.diagnose(campaign)
result

# %%
# The parameters of what was found, in SI units, as far as the measurements identify them.
# Each joint has waves of its gear with one, two or more periods a turn.
parameters = [
    (parameter.name, parameter.value, parameter.std_error, parameter.unit)
    for effect in result.effects
    for parameter in effect.parameters
    if parameter.identifiable
]
pd.DataFrame(parameters, columns=["parameter", "value", "std_error", "unit"]).head(12)

# %%
# Other mechanisms were tested too. The figure shows how probable each hypothesis is.
candidates = result.plot.candidates()
candidates

# %%
# The residuals before and after: each arrow is the error at one pose, from the side and
# from above.
residuals = result.plot.residuals()
residuals
