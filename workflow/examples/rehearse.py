"""Rehearse a calibration: a physical robot in simulation, with hidden defects, stands in for a real one.

    python workflow/examples/rehearse.py measure FOLDER                  fills the measurement sheet of a campaign
    python workflow/examples/rehearse.py path FOLDER PATH.csv            writes a path of 50 poses, as for milling
    python workflow/examples/rehearse.py move FOLDER PATH.csv OUT.csv    goes along it, uncorrected and corrected

FOLDER is the campaign; PATH.csv has the wanted poses and OUT.csv the joint targets of `elastocal correct`. The robot follows
from the robot file of the campaign, --seed and --effect, and is the same in all three. Errors of `move` are what
the tracker reads, in the campaign's frame of the base; its noise and the repeatability alone leave those of the last line.
"""

import argparse
import io
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from elastocal.blind.closed_loop import bow
from elastocal.blind.rehearsal import (
    filled_sheet,
    hidden_robot,
    measured_errors,
    require_numbers,
    with_lost_beam,
    with_misplaced_base,
)
from elastocal.campaigns.measurements import CSV
from elastocal.campaigns.reading import read_descriptions, read_robot
from elastocal.errors import InputError
from elastocal.exchange.csv_dialect import LARGEST_BYTES
from elastocal.exchange.target_path import read_target_path
from elastocal.io.atomic_writes import atomic_write, check_places
from elastocal.io.texts import read_text
from elastocal.plant.campaigns import usual_force_N

ROBOTS = Path("config/robots")


def table_of(path):
    try:
        return pd.read_csv(io.StringIO(read_text(path, LARGEST_BYTES)))
    except (pd.errors.EmptyDataError, pd.errors.ParserError) as error:
        raise InputError(path.as_posix(), "table", str(error).strip().splitlines()[-1], "columns under one header") from error


def measure(given, robot, document):
    path = given.folder / CSV
    check_places(path)
    filled = filled_sheet(table_of(path), document, robot, given.seed, path.as_posix())
    if given.lost_beam:
        filled, row = with_lost_beam(filled, given.seed)
        print(f"the beam is lost in line {row + 2}")
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
    targets = table_of(given.targets)
    wrench = np.zeros((len(wanted), 6)) if wanted.wrench is None else wanted.wrench
    errors = {}
    for name, ending in (("uncorrected", "_uncorrected"), ("corrected", "")):
        columns = [f"q{joint}{ending}" for joint in range(1, robot.arm.joints + 1)]
        require_numbers(targets, columns, given.targets.as_posix())
        angles = targets[columns].to_numpy(float)
        if len(angles) != len(wanted):
            allowed = f"{len(wanted)}, the poses of {given.path}"
            raise InputError(given.targets.as_posix(), "rows", str(len(angles)), allowed)
        errors[name], errors["noise alone"] = measured_errors(
            robot, angles, wrench, wanted.position, given.seed, given.targets.as_posix()
        )
    rms = {name: 1e3 * np.sqrt((error**2).mean()) for name, error in errors.items()}
    for name in ("uncorrected", "corrected", "noise alone"):
        print(f"{name:12} position error: RMS {rms[name]:.3f} mm, largest {1e3 * errors[name].max():.3f} mm")
    if rms["corrected"] >= rms["uncorrected"]:
        sys.exit("the corrected robot is no better")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_subparsers(required=True)
    for run in (measure, path, move):
        command = what.add_parser(run.__name__)
        command.add_argument("folder", type=Path)
        if run is not measure:
            command.add_argument("path", type=Path)
        command.add_argument("--misplaced-base", action="store_true", help="the tracker's base frame is not quite the robot's")
        if run is measure:
            command.add_argument("--lost-beam", action="store_true", help="one row, which is drawn, reads zeros")
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
        if given.misplaced_base:
            robot = with_misplaced_base(robot, given.seed)
        given.run(given, robot, document)
    except InputError as error:
        sys.exit(str(error))
    if given.reveal:
        print("hidden:", *(f"{defect.effect} {defect.joints or ''}" for defect in defects[-max(len(given.effect), 1) :]))
