"""Rehearse a calibration: a physical robot in simulation, with hidden defects, stands
in for a real one.

    python workflow/examples/rehearse.py measure FOLDER                  fills the measurement sheet of a campaign
    python workflow/examples/rehearse.py path FOLDER PATH.csv            writes a path of 50 poses, as for milling
    python workflow/examples/rehearse.py move FOLDER PATH.csv OUT.csv    goes along it, uncorrected and corrected

FOLDER is the campaign; PATH.csv has the wanted poses and OUT.csv the joint targets of
`elastocal correct`. The robot follows from the robot file of the campaign, --seed and
--effect, and is the same in all three. Errors of `move` are what the tracker reads, in
the campaign's frame of the base; its noise and the repeatability alone leave those of
the last line.
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


def move(given, robot, campaign):
    missed = measure_errors(given.path, given.targets, robot, given.seed)
    rms = {name: 1e3 * np.sqrt((off**2).mean()) for name, off in missed.items()}
    for name, off in missed.items():
        print(
            f"{name:12} position error: RMS {rms[name]:.3f} mm, largest {1e3 * off.max():.3f} mm"
        )
    if rms["corrected"] >= rms["uncorrected"]:
        sys.exit("the corrected robot is no better")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    what = parser.add_subparsers(required=True)
    for run in (measure, path, move):
        command = what.add_parser(run.__name__)
        command.add_argument("folder", type=Path)
        if run is not measure:
            command.add_argument("path", type=Path)
        if run is move:
            command.add_argument("targets", type=Path)
        command.add_argument("--seed", type=int, default=1)
        command.add_argument(
            "--effect",
            action="append",
            default=[],
            help="a hidden effect; one is drawn without",
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
