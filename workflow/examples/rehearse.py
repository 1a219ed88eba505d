"""Rehearse a calibration: a physical robot in simulation, with hidden defects, stands in for a real one.

    python workflow/examples/rehearse.py measure FOLDER                  fills the measurement sheet of a campaign
    python workflow/examples/rehearse.py path FOLDER PATH.csv            writes a path of 50 poses, as for milling
    python workflow/examples/rehearse.py move FOLDER PATH.csv OUT.csv    goes along it, uncorrected and corrected

FOLDER is the campaign; PATH.csv has the wanted poses and OUT.csv the joint targets of `elastocal correct`. The robot follows
from the robot file of the campaign, --seed and --effect, and is the same in both.
"""

import argparse
import io
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from elastocal.blind.closed_loop import bow
from elastocal.blind.rehearsal import filled_sheet, hidden_robot, reached
from elastocal.campaigns.measurements import CSV
from elastocal.campaigns.reading import read_descriptions, read_robot
from elastocal.errors import InputError
from elastocal.exchange.csv_dialect import LARGEST_BYTES
from elastocal.exchange.target_path import read_target_path
from elastocal.io.atomic_writes import atomic_write, check_places
from elastocal.io.texts import read_text
from elastocal.plant.campaigns import usual_force_N

ROBOTS = Path("config/robots")


def measure(given, robot, document):
    path = given.folder / CSV
    check_places(path)
    filled = filled_sheet(
        pd.read_csv(io.StringIO(read_text(path, LARGEST_BYTES))), document, robot, given.seed, path.as_posix()
    )
    with atomic_write(path) as partial:
        filled.to_csv(partial, index=False)
    print(f"{len(filled)} measurements in {path}")


def path(given, robot, document):
    check_places(given.path)
    declared = read_robot(read_descriptions(given.folder, ROBOTS)[1])
    at, turned, angles = bow(declared, 0.2 * robot.arm.reach_m, 50, np.random.default_rng(given.seed))
    force = np.tile([0.0, 0.0, usual_force_N(robot.arm) / 2, 0.0, 0.0, 0.0], (len(at), 1))
    names = ["x", "y", "z", "rx", "ry", "rz", "fx", "fy", "fz", "mx", "my", "mz", *(f"q{j + 1}" for j in range(len(angles[0])))]
    columns = np.column_stack([at, Rotation.from_matrix(turned).as_rotvec(), force, angles])
    with atomic_write(given.path) as partial:
        pd.DataFrame(columns, columns=names).to_csv(partial, index=False)
    print(f"{len(at)} poses in {given.path}")


def move(given, robot, document):
    wanted = read_target_path(given.path, robot.arm.joints)
    targets = pd.read_csv(io.StringIO(read_text(given.targets, LARGEST_BYTES)))
    wrench = np.zeros((len(wanted), 6)) if wanted.wrench is None else wanted.wrench
    rms = []
    for name, ending in (("uncorrected", "_uncorrected"), ("corrected", "")):
        angles = targets[[f"q{joint}{ending}" for joint in range(1, robot.arm.joints + 1)]].to_numpy()
        off = 1e3 * np.linalg.norm(reached(robot, angles, wrench, given.seed)[0] - wanted.position, axis=1)
        rms.append(np.sqrt((off**2).mean()))
        print(f"{name:12} position error: RMS {rms[-1]:.3f} mm, largest {off.max():.3f} mm")
    if rms[1] >= rms[0]:
        sys.exit("the corrected robot is no better")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_subparsers(required=True)
    for run in (measure, path, move):
        command = what.add_parser(run.__name__)
        command.add_argument("folder", type=Path)
        if run is not measure:
            command.add_argument("path", type=Path)
        if run is move:
            command.add_argument("targets", type=Path)
        command.add_argument("--seed", type=int, default=1)
        command.add_argument("--effect", action="append", default=[], help="a hidden effect; one is drawn without")
        command.add_argument("--reveal", action="store_true", help="say what was hidden")
        command.set_defaults(run=run)
    given = parser.parse_args()
    try:
        document, robot_file = read_descriptions(given.folder, ROBOTS)
        robot, defects = hidden_robot(robot_file, given.seed, given.effect)
        given.run(given, robot, document)
    except InputError as error:
        sys.exit(str(error))
    if given.reveal:
        print("hidden:", *(f"{defect.effect} {defect.joints or ''}" for defect in defects[-max(len(given.effect), 1) :]))
