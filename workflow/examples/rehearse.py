"""Rehearse a calibration with a simulated robot that has hidden defects.

    rehearse.py measure FOLDER                 fill the measurement sheet of a campaign
    rehearse.py path FOLDER PATH.csv           write a path of 50 poses, as for milling
    rehearse.py remeasure FOLDER OUT.csv MEASURED.csv
                                               measure the robot at corrected targets
    rehearse.py move FOLDER PATH.csv OUT.csv   follow it, uncorrected and corrected

FOLDER is the campaign; PATH.csv has the wanted poses, OUT.csv the joint targets of
`elastocal correct`, and MEASURED.csv is for `elastocal verify`. The robot follows from
the robot file of the campaign, --seed and --effect, and is the same in all of them.
Errors of `move` are those that the tracker measures in the campaign's base frame. The
last line gives the errors that the noise of the tracker and the repeatability of the
robot cause alone.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.measurements import CSV
from elastocal.errors import InputError
from elastocal_proof.blind.rehearsal import (
    build_hidden_robot,
    describe_hidden_effects,
    fill_sheet,
    measure_errors,
    measure_targets,
    misplace_base,
    write_milling_path,
)

ROBOTS = Path("config/robots")


def measure(given, robot, campaign):
    path = given.folder / CSV
    count = fill_sheet(path, campaign.document, robot, given.seed)
    print(f"{count} measurements in {path}")


def path(given, robot, campaign):
    count = write_milling_path(given.path, campaign.robot, robot, given.seed)
    print(f"{count} poses in {given.path}")


def remeasure(given, robot, campaign):
    count = measure_targets(
        given.targets, given.measured, campaign.document, robot, given.seed
    )
    print(f"{count} measurements in {given.measured}")


def move(given, robot, campaign):
    errors_m = measure_errors(given.path, given.targets, robot, given.seed)
    rms = {name: 1e3 * np.sqrt((error**2).mean()) for name, error in errors_m.items()}
    for name, error in errors_m.items():
        largest = 1e3 * error.max()
        print(f"{name:12} position error: RMS {rms[name]:.3f} mm,", end=" ")
        print(f"largest {largest:.3f} mm")
    if rms["corrected"] >= rms["uncorrected"]:
        sys.exit("the corrected robot is no better")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    subcommands = parser.add_subparsers(required=True)
    for run in (measure, path, remeasure, move):
        command = subcommands.add_parser(run.__name__)
        command.add_argument("folder", type=Path)
        if run in (path, move):
            command.add_argument("path", type=Path)
        if run in (remeasure, move):
            command.add_argument("targets", type=Path)
        if run is remeasure:
            command.add_argument("measured", type=Path)
        command.add_argument("--seed", type=int, default=1)
        command.add_argument(
            "--effect",
            action="append",
            default=[],
            help="a hidden effect; one is drawn by default",
        )
        command.add_argument(
            "--misplaced-base",
            action="store_true",
            help="the tracker's base frame is not quite the robot's",
        )
        command.add_argument(
            "--reveal", action="store_true", help="say what was hidden"
        )
        command.set_defaults(run=run)
    given = parser.parse_args()
    try:
        campaign = read_campaign_folder(given.folder, ROBOTS)
        robot, defects = build_hidden_robot(
            campaign.robot_file, given.seed, given.effect
        )
        if given.misplaced_base:
            robot = misplace_base(robot, given.seed)
        given.run(given, robot, campaign)
    except InputError as error:
        sys.exit(str(error))
    if given.reveal:
        print(f"hidden: {describe_hidden_effects(defects, given.effect)}")
