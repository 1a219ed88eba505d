"""How often effects of the gears that are not linear in the torque get their name
where the arm has weight.

Simulated robots of `elastocal_proof.plant`, which share no code with the fitted model:
the file states masses to 10 %, the compliances are to be identified, and one of the
joints that carry the arm has lost motion, stiffens, or has a wrong ratio (linear in
nothing but its angle, as a control). `python benchmarks/torque_laws.py CASES
FIRST_SEED [ROBOT...]` prints for each law how often its name leads, how often another
one is stated at 65 % or more, and how often nothing is.
"""

import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml
from common import ROBOTS
from rates import make_parser
from weak_springs import FALSE_NAME, declare_masses, write_simulated_campaign

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import read_cases
from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import Design
from elastocal_proof.plant.kinds import draw_defect
from elastocal_proof.plant.simulated_robot import draw_specimen

ARMS = ("kuka", "iiwa14")
LAWS = ("lost_motion", "stiffening", "transmission_ratio")


def diagnose_one(name: str, law: str, seed: int, force: float) -> dict[str, Any]:
    """Diagnose the campaign of one defective robot."""
    draws = np.random.default_rng([seed, 6])
    robot_file = ROBOTS / f"{name}.yaml"
    arm = read_arm(robot_file)
    joint = int(draws.integers(2, 5))
    defect = draw_defect(law, arm, seed)
    size = float(draws.uniform(1.0, 3.0)) * defect.size
    if law == "stiffening":
        size = min(size, 0.9)
    defect = replace(defect, joints=(joint,), size=size)
    robot = defect.on(draw_specimen(arm, seed))[0]
    design = Design(
        poses=40,
        held_out=8,
        force_times=force,
        ladder=(0.0, 1.0, -1.0),
        repeats=2,
        repeated_poses=6,
        points=(arm.points[-1],),
        covariates=(),
    )
    with TemporaryDirectory() as top:
        folder = Path(top, f"{name}_{seed}")
        write_simulated_campaign(folder, robot, design, seed)
        (folder / "robot.yaml").write_text(
            yaml.safe_dump(declare_masses(robot_file)), encoding="utf-8"
        )
        training, _ = read_cases(folder, ROBOTS)
    probabilities = diagnose(training, Settings(), 1).document["probabilities"]
    named = {
        effect: round(probability, 3)
        for effect, probability in (probabilities or {"mechanisms": {}})[
            "mechanisms"
        ].items()
        if effect != "other"
    }
    return {"robot": name, "law": law, "joint": joint, "seed": seed, "named": named}


def main() -> None:
    parser = make_parser(__doc__, ARMS)
    parser.add_argument(
        "--force", type=float, default=0.3, help="largest force over the typical one"
    )
    parser.add_argument("--laws", nargs="*", default=LAWS)
    options = parser.parse_args()
    print("law cases right wrong nothing")
    for law in options.laws:
        counts = {"right": 0, "wrong": 0, "nothing": 0}
        cases = 0
        for seed in range(options.first_seed, options.first_seed + options.cases):
            for name in options.robots:
                row = diagnose_one(name, law, seed, options.force)
                cases += 1
                leading = max(row["named"], key=row["named"].get, default="")
                probability = row["named"].get(leading, 0.0)
                if probability < FALSE_NAME:
                    counts["nothing"] += 1
                else:
                    counts["right" if leading == law else "wrong"] += 1
                if options.each:
                    print(json.dumps(row), flush=True)
        print(law, cases, *counts.values(), flush=True)


if __name__ == "__main__":
    main()
