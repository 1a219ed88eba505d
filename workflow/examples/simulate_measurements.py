"""Fill the folder of a campaign with simulated measurements.

It shows the format and lets you try a diagnosis without a robot.

Usage: python workflow/examples/simulate_measurements.py FOLDER ROBOT_FILE. FOLDER has a
campaign.yaml that measures poses in the base frame; ROBOT_FILE is the simulated robot,
which may have effects that the declared one lacks.
"""

import argparse
import sys
from pathlib import Path

from elastocal.campaigns.campaign import DOCUMENT, parse_targets
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.measurements import CSV, write_measurements
from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.simulation import Plan, draw_measurements
from elastocal.errors import InputError

LADDER = (0.0, 1.0, 0.5, -0.5, -1.0)


def measure(folder: Path, robot_file: Path, seed: int) -> None:
    document = read_campaign_folder(folder, "config/robots").document
    robot = read_robot(robot_file)
    targets = parse_targets(
        document["targets"], robot.chain, (folder / DOCUMENT).as_posix()
    )
    plan = Plan(
        tuple(target.point for target in targets),
        30,
        1000.0,
        LADDER,
        (0.0, 0.5, 0.0),
        4,
        10,
        6e-5,
        6e-5,
    )
    table = draw_measurements(robot, plan, seed, document["campaign"])
    names = {target.point: target.name for target in targets}
    table["target"] = [names[point] for point in table["target"]]
    path = folder / CSV
    write_measurements(path, table, robot.joints)
    print(f"{len(table['pose'])} measurements in {path}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("robot_file", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    try:
        measure(given.folder, given.robot_file, given.seed)
    except InputError as error:
        sys.exit(str(error))
