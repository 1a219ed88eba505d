"""
Plan the measurements and correct a path
========================================

Where to measure decides how well a robot can be corrected. A plan chooses configurations
that determine the robot best and predicts the accuracy before anything is measured.
"""

# %%
# Twenty-five planned configurations, and ten random ones that judge the result.
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

import elastocal as ec
from elastocal.mechanics.kinematics import compute_poses

robot = ec.read_robot(
    "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.5) Ry(q3) Tx(0.2) Rx(q4) Tx(0.2) Ry(q5) Rx(q6)"
    " Tx(0.1) [tool]"
)
plan = ec.plan(robot, poses=25, held_out=10)
plan

# %%
# The real robot here is a simulated one: its second and third links are half a millimetre
# longer and its third joint is a milliradian off.
real = ec.read_robot(
    "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.5005) Ry(q3) Ry(0.05deg) Tx(0.2005) Rx(q4) Tx(0.2)"
    " Ry(q5) Rx(q6) Tx(0.1) [tool]"
)


def move(joint_angles):
    """Return the poses (N, 3), (N, 3, 3) that the real robot reaches."""
    return compute_poses(real.chain, joint_angles, real.chain.end_effector)


# %%
# Measure the planned configurations with a tracker whose noise is 20 µm and whose frame is
# registered to the robot's base.
q = np.vstack([plan.joint_angles, plan.held_out_angles])
x = move(q)[0] + np.random.default_rng(1).normal(scale=2e-5, size=(len(q), 3))
held_out = {"poses": [*range(26, 36)]}
campaign = ec.Campaign(
    robot,
    joint_angles=q,
    positions=x,
    frame="base",
    holdout=held_out,
    noise={"position_m": 2e-5},
)
result = ec.diagnose(campaign)
print(result)

# %%
# A path of the tool: a circle of 200 mm with the tool pointing down. `correct` returns
# the joint targets that reach it, with the errors that it predicts.
turn = np.linspace(0, 2 * np.pi, 60)
wanted = np.column_stack(
    [0.6 + 0.1 * np.cos(turn), 0.1 * np.sin(turn), np.full(60, 0.3)]
)
tool_down = Rotation.from_euler("y", 90, degrees=True).as_rotvec()
path = pd.DataFrame(wanted, columns=["x", "y", "z"])
path[["rx", "ry", "rz"]] = tool_down
corrected = result.robot.correct(path)
corrected.table.filter(like="predicted").describe().loc[["mean", "max"]]

# %%
# Does it hold? The real robot moves to the joint targets of the nominal model and to the
# corrected ones.
joints = [f"q{joint}" for joint in range(1, 7)]
before = move(corrected.table[[f"{name}_uncorrected" for name in joints]].to_numpy())[0]
after = move(corrected.table[joints].to_numpy())[0]
figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
for reached, label in [(before, "nominal model"), (after, "corrected")]:
    errors_mm = 1e3 * np.linalg.norm(reached - wanted, axis=1)
    axes.semilogy(np.degrees(turn), errors_mm, label=label)
bound_mm = 1e3 * corrected.table["predicted_bound_m"]
axes.semilogy(np.degrees(turn), bound_mm, "--", label="predicted 95 % bound")
axes.set(xlabel="angle along the circle (degrees)", ylabel="position error (mm)")
figure.legend(loc="outside upper center", ncols=3)
plt.show()
