"""How close a diagnosis gets to the best possible where weights are not declared.

Simulated robots of `elastocal_proof.plant`, which share no code with the fitted model,
whose bodies have their centres off the lines of their links. Arms of six and seven axes
have joints that coincide. The analyst's file has neither masses nor compliances; the
best possible is the diagnosis of the same measurements with the masses declared to
10 %. `python benchmarks/weight_between_joints.py CASES FIRST_SEED [ROBOT...]` prints
for each robot the geometric mean of the ratio of the held-out errors, and the median
pose error that either takes for noise.
"""

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml
from common import ROBOTS
from rates import make_parser
from weak_springs import declare_masses, write_simulated_campaign

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import read_cases
from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import Design
from elastocal_proof.plant.simulated_robot import draw_specimen

ARMS = ("panda", "wam", "iiwa14", "kuka")
OFF_LINE_M = 0.05


def diagnose_one(name: str, seed: int, *, declared: bool) -> dict[str, Any]:
    """Diagnose one campaign, with or without the masses in the analyst's file."""
    robot_file = ROBOTS / f"{name}.yaml"
    document = declare_masses(robot_file)
    if not declared:
        del document["masses"]
    arm = read_arm(robot_file)
    design = Design(
        poses=48,
        held_out=16,
        ladder=(0.0, 1.0),
        repeats=2,
        repeated_poses=6,
        points=(arm.points[-1],),
        covariates=(),
    )
    robot = draw_specimen(arm, seed, off_line_m=OFF_LINE_M * min(arm.reach_m, 1.5))
    with TemporaryDirectory() as top:
        folder = Path(top, f"{name}_{seed}")
        write_simulated_campaign(folder, robot, design, seed)
        (folder / "robot.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
        training, held_out = read_cases(folder, ROBOTS)
    verdict = judge(diagnose(training, Settings(), 1), held_out, 1).document
    return {
        "rms_m": verdict["heldout"]["after"]["rms_m"],
        "floor_m": verdict["heldout"]["noise_floor_rms_m"],
        "pose_rad": verdict["noise"]["pose_rad"],
        "effects": [effect["name"] for effect in verdict["effects"]],
    }


def main() -> None:
    options = make_parser(__doc__, ARMS).parse_args()
    print("robot cases ratio_to_best largest_ratio pose_urad pose_urad_of_best")
    for name in options.robots:
        without = []
        best = []
        for seed in range(options.first_seed, options.first_seed + options.cases):
            without.append(diagnose_one(name, seed, declared=False))
            best.append(diagnose_one(name, seed, declared=True))
            if options.each:
                print(json.dumps([name, seed, without[-1], best[-1]]), flush=True)
        pairs = zip(without, best, strict=True)
        ratios = np.array([mine["rms_m"] / yours["rms_m"] for mine, yours in pairs])
        print(
            name,
            len(ratios),
            f"{np.exp(np.log(ratios).mean()):.3f}",
            f"{ratios.max():.3f}",
            f"{1e6 * np.median([row['pose_rad'] for row in without]):.1f}",
            f"{1e6 * np.median([row['pose_rad'] for row in best]):.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
