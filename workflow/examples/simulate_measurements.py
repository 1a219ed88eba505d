"""Fill the folder of a campaign with measurements of a simulated robot, to see the format and to try the loop without one.

Usage: python workflow/examples/simulate_measurements.py FOLDER ROBOT_FILE. FOLDER has a campaign.yaml that measures poses in
the base frame; ROBOT_FILE is the robot that is measured, which may have more than the one that the campaign declares.
"""

import argparse
from pathlib import Path

from elastocal.campaigns.measurements import CSV, write_measurements
from elastocal.campaigns.reading import read_descriptions, read_robot
from elastocal.campaigns.simulation import Plan, simulated_measurements
from elastocal.io.atomic_writes import atomic_write

LADDER = (0.0, 1.0, 0.5, -0.5, -1.0)

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("robot_file", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    document, _ = read_descriptions(given.folder, Path("config/robots"))
    robot = read_robot(given.robot_file)
    points = [target["point"] for target in document["targets"].values()]
    plan = Plan(tuple(points), 30, 1000.0, LADDER, (0.0, 0.5, 0.0), 4, 10, 6e-5, 6e-5)
    table = simulated_measurements(robot, plan, given.seed, document["campaign"])
    names = {target["point"]: name for name, target in document["targets"].items()}
    table["target"] = [names[point] for point in table["target"]]
    path = given.folder / CSV
    with atomic_write(path) as partial:
        write_measurements(partial, table, robot.joints)
    print(f"{len(table['pose'])} measurements in {path}")
