"""A few poses of a service robot, an arm of seven joints on a lift, with wrong zeros and
lengths and with backlash in its drives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from made_folders import make_folder

from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.mechanics.robot_file import parse_robot

SERVICE_ARM = yaml.safe_load(
    Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8")
)
# Backlash of the drives, rad; of the lift, m.
_PLAY = 5e-3 * np.array([0.2, 1, 1, 1, 1, 1, 1, 1])


def service_arm_folder(folder, seed, poses=34, noise_m=3e-4):
    """Write a campaign as `elastocal init` declares it, with errors of 5 mm that a
    calibration can hardly reduce."""
    rng = np.random.default_rng((7, seed))
    lengths = {
        name: value + 1e-3 * rng.standard_normal()
        for name, value in SERVICE_ARM["lengths_m"].items()
    }
    true = replace(
        parse_robot(SERVICE_ARM | {"lengths_m": lengths}),
        compliance=np.zeros(8),
    )
    plan = Plan(("8DoF",), poses, 0.0, (0,), (0.0, 0.0, 0.0), 1, 0, 1e-3, 1e-3)
    table = draw_measurements(true, plan, seed, "service")
    zeros = 0.2 * _PLAY * rng.standard_normal(8)
    for joint in range(8):
        table[f"q{joint + 1}"] = (
            table[f"q{joint + 1}"]
            + zeros[joint]
            + _PLAY[joint] * rng.standard_normal(poses)
        )
    changes = {
        "robot": "robot.yaml",
        "frame": "tracker",
        "targets": {"8DoF": {"point": "8DoF", "offset_m": "unknown"}},
    }
    changes |= {
        "declared": ["joint_offset", "link_geometry"],
        "noise": {"position_m": noise_m},
    }
    make_folder(folder, true, "service", table=table, **changes)
    (folder / "robot.yaml").write_text(yaml.safe_dump(SERVICE_ARM), encoding="utf-8")
    return folder
