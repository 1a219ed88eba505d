"""
A robot in MuJoCo, corrected
============================

The loop closed on a robot that elastocal has not built: MuJoCo computes where an arm with
wrong link lengths and elastic joints comes to rest. It is measured, diagnosed, corrected
and measured again.
"""

# %%
# The arm as MuJoCo has it. Its links weigh 30, 20, 6, 4, 2 and 1 kg, a link is 0.6 mm too
# long, and the axis of a joint is tilted.
import matplotlib.pyplot as plt
import mujoco
import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

import elastocal as ec
from elastocal.mechanics.kinematics import compute_poses

MJCF = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body pos="0 0 0.4"><joint axis="0 0 1"/>
      <inertial pos="0 0 0" mass="30" diaginertia="1 1 1"/>
    <body pos="0.1 0 0"><joint axis="0 1 0.0005"/>
      <inertial pos="0.25 0 0" mass="20" diaginertia="1 1 1"/>
    <body pos="0.5006 0 0"><joint axis="0 1 0"/>
      <inertial pos="0.1 0 0" mass="6" diaginertia="1 1 1"/>
    <body pos="0.2 0 0"><joint axis="1 0 0"/>
      <inertial pos="0.1 0 0" mass="4" diaginertia="1 1 1"/>
    <body pos="0.2 0 0"><joint axis="0 1 0"/>
      <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
    <body pos="0 0 0"><joint axis="1 0 0"/>
      <inertial pos="0.05 0 0" mass="1" diaginertia="1 1 1"/>
      <site name="tool" pos="0.1 0 0"/>
    </body></body></body></body></body></body>
  </worldbody>
</mujoco>
"""
model = mujoco.MjModel.from_xml_string(MJCF)
data = mujoco.MjData(model)
compliance = 1e-6 * np.array([5, 6, 8, 20, 30, 40])  # rad/(N m)


def move(joint_angles):
    """Return the positions (N, 3) at which the tool comes to rest, m."""
    positions = []
    for commanded in joint_angles:
        data.qpos[:] = commanded
        # The weights turn the elastic joints, which changes their torques a little.
        for _ in range(5):
            mujoco.mj_forward(model, data)
            data.qpos[:] = commanded - compliance * data.qfrc_bias
        mujoco.mj_forward(model, data)
        positions.append(data.site("tool").xpos.copy())
    return np.array(positions)


# %%
# Its user knows the nominal chain, and measures 60 random configurations with a noise of
# 20 µm.
robot = ec.read_robot(
    "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.5) Ry(q3) Tx(0.2) Rx(q4) Tx(0.2) Ry(q5) Rx(q6)"
    " Tx(0.1) [tool]"
)
draws = np.random.default_rng(7)
q = draws.uniform(-2.5, 2.5, size=(60, 6))
x = move(q) + draws.normal(scale=2e-5, size=(60, 3))
campaign = ec.Campaign(
    robot, joint_angles=q, positions=x, frame="base", noise={"position_m": 2e-5}
)
result = ec.diagnose(campaign)
print(result)

# %%
# The user wants the tool at 100 other poses, those of the nominal robot at some joint
# angles. `correct` keeps the posture that these angles have; poses at which the robot is
# singular are left out. The poses are no path, so joints may move far between them.
nominal = draws.uniform(-2.0, 2.0, size=(100, 6))
wanted, rotations = compute_poses(robot.chain, nominal, robot.chain.end_effector)
turns = Rotation.from_matrix(rotations).as_rotvec()
joints = [f"q{joint}" for joint in range(1, 7)]
path = pd.DataFrame(
    np.hstack([wanted, turns, nominal]),
    columns=["x", "y", "z", "rx", "ry", "rz", *joints],
)
targets = result.robot.correct(path, partial=True, allow_large_steps=True).table
reached = targets["q1"].notna().to_numpy()
corrected = targets.loc[reached, joints].to_numpy()

# %%
# MuJoCo moves the arm to both commands.
before_mm = 1e3 * np.linalg.norm(move(nominal[reached]) - wanted[reached], axis=1)
after_mm = 1e3 * np.linalg.norm(move(corrected) - wanted[reached], axis=1)
for name, errors_mm in [("nominal", before_mm), ("corrected", after_mm)]:
    print(f"{name}: {np.sqrt(np.mean(errors_mm**2)):.3f} mm RMS")
figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
bins = np.geomspace(0.003, 3, 40)
axes.hist(before_mm, bins, alpha=0.7, label="nominal commands")
axes.hist(after_mm, bins, alpha=0.7, label="corrected commands")
axes.axvline(
    1e3 * targets["predicted_error_after_m"].mean(),
    color="black",
    linestyle="--",
    label="predicted for the corrected ones",
)
axes.set(xscale="log", xlabel="position error in MuJoCo (mm)", ylabel="poses")
axes.legend()
plt.show()
