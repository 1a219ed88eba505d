"""
An effect of your own as a plug-in
==================================

A package of your own can add an effect to the catalogue. Every diagnosis then considers
it beside the other mechanisms. Here hoses along the arm resist its rotation, more the
further a joint has turned.
"""

# %%
# The effect is a function with a decorator. It states where the effect can act, how large
# it plausibly is, and which displacements it causes: a rotation of a joint by the cube of
# its angle.
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import elastocal as ec

MODULE = '''
from elastocal.effects.protocol import effect, turning_joints
from elastocal.effects.sizes import Size


@effect(
    "elastic",
    "resistance of hoses",
    Size("turn", 1e-4, "a tenth of a milliradian at one radian"),
    at=turning_joints,
    formula=r"\\theta = k q^3",
)
def hoses(entry, sites, joint):
    """Hoses along the arm that resist its rotation."""
    cubic = entry.parameters("turn", ["cubic"], "rad/rad^3", sites)
    yield entry.of_joint(
        joint,
        cubic,
        lambda around: [around.joint_angles[:, joint] ** 3],
        distinct_angles=4,
        fixed=True,
    )
'''

# %%
# `pyproject.toml` of your package names the effect, and `pip install` records it. This
# example writes the record itself, so that nothing has to be installed.
package = Path(tempfile.mkdtemp())
(package / "my_hoses.py").write_text(MODULE)
record = package / "my_hoses-1.0.dist-info"
record.mkdir()
(record / "METADATA").write_text(
    "Metadata-Version: 2.1\nName: my_hoses\nVersion: 1.0\n"
)
(record / "entry_points.txt").write_text(
    "[elastocal.effects]\nhoses = my_hoses:hoses\n"
)

# %%
# A robot with such hoses at its second joint: they turn it further than its controller
# reports.
robot = ec.read_robot(
    "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.5) Ry(q3) Tx(0.2) Rx(q4) Tx(0.2) Ry(q5) Rx(q6)"
    " Tx(0.1) [tool]"
)
table = ec.simulate(robot, poses=60, noise_m=2e-5)
angles = [f"q{joint}" for joint in range(1, 7)]
turned = table["q2"].to_numpy()
hidden = 2e-5
reported = turned - hidden * turned**3
table["q2"] = reported

# %%
# The diagnosis names the new effect. Python finds the package on its path, as it finds
# installed ones.
sys.path.insert(0, str(package))
campaign = ec.Campaign.from_table(robot, table, frame="base")
result = ec.diagnose(campaign)
print(result)

# %%
# It estimates the size of the effect as well.
(found,) = result.effects
(cubic,) = found.parameters
print(
    f"hidden {hidden:.2e}, found {cubic.value:.2e} ± {cubic.std_error:.1e} {cubic.unit}"
)
angle = np.linspace(reported.min(), reported.max())
figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
axes.plot(angle, 1e3 * hidden * angle**3, label="hidden in the simulated robot")
axes.plot(angle, 1e3 * cubic.value * angle**3, "--", label="found")
axes.plot(reported, np.zeros_like(reported), "|", color="gray", label="measured poses")
axes.set(xlabel="angle of joint 2 (rad)", ylabel="rotation by the hoses (mrad)")
axes.legend()
plt.show()
