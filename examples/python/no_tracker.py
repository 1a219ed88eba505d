"""
Calibrate a Panda without a tracker
===================================

A ball on the flange is pushed by hand into the two sockets of a printed tool, and only the
joint angles are read. Whenever the ball is in a socket, the flange is where it was
before: that is the measurement.
"""

# %%
# The campaign has the joint angles of 170 poses of a Franka Panda, measured by the authors
# of MUKCa (MIT licence, see the page on the data that come with elastocal). The tool stood
# at eight places, which are sessions; where they are is unknown. The two sockets are 50 mm
# apart, as printed.
import elastocal as ec
from elastocal.command.terminal import find_pipeline

files = find_pipeline()  # the checkout, or the files that the wheel has installed
campaign = ec.read_campaign(
    files / "data/measured/panda_2_sockets", robots_folder=files / "config/robots"
)
print(campaign)

# %%
# From here nothing differs from a campaign of a tracker.
result = ec.diagnose(campaign)
print(result)

# %%
# The errors are distances of the ball from its socket, at 51 poses that no step has seen.
# Nothing says where the base of the robot is: no tool that stands anywhere can.
for step, rms_m in zip(
    result.errors["step"], result.errors["heldout_rms_m"], strict=True
):
    print(f"{1e3 * rms_m:.3f} mm  {step}")

# %%
# The geometry explains nearly all of the error; how much more the effects explain, 51
# poses can hardly say, as the intervals show.
errors = result.plot.errors()
errors
