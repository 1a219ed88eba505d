"""CPU seconds of `elastocal correct` without joint angles (docs/running.md).

Usage: python benchmarks/corrections.py [ROBOT ...] [--targets 10000] [--runs 3]. Each
robot is measured in a simulation at 60 random poses and diagnosed; the command then
corrects the path of `target_path.py` by the robot's model file. Import and output are part
of the seconds; "slower" is how many times as long this machine takes for a fixed piece of
work as the idle one of the limits. Targets that the robot does not reach are left out.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from common import compare_processor, load_robot, measure_cpu
from target_path import make_target_path

import elastocal as ec
from elastocal.exchange.target_path import OK
from elastocal.mechanics.robot import Robot

# Six axes with a spherical wrist, six with three parallel ones, and seven.
ROBOTS = ("kuka_extended", "ur10", "iiwa14")
_POSES = 60
_FORCE_N = 300.0
# What the robot's file does not know: zeros of the joints, rad.
_OFFSET_RAD = 1e-3


def write_model(robot: Robot, path: Path) -> None:
    """Measure a robot with wrong zeros in a simulation, diagnose it, and write its model
    file."""
    offset = _OFFSET_RAD * np.random.default_rng(2).standard_normal(robot.joints)
    faulty = replace(robot, reported_offset=robot.reported_offset + offset)
    table = ec.simulate(faulty, poses=_POSES, force_N=_FORCE_N, seed=3)
    campaign = ec.Campaign.from_table(robot, table, compliance="nominal")
    ec.diagnose(campaign).robot.save(path)


def correct(folder: Path) -> tuple[float, pd.DataFrame]:
    """Run the command in a folder; return its CPU seconds and the targets."""
    files = ["arm.json", "path.csv", "--output", "targets.csv"]
    options = ["--partial", "--force", "--allow-large-steps"]
    run = partial(
        subprocess.run,
        [sys.executable, "-m", "elastocal", "correct", *files, *options],
        cwd=folder,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    _, seconds = measure_cpu(run)
    return seconds, pd.read_csv(folder / "targets.csv")


def main() -> None:
    """Print a line for each robot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", default=ROBOTS)
    parser.add_argument("--targets", type=int, default=10_000)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--models", type=Path, help="folder that keeps the model files")
    options = parser.parse_args()
    for name in options.robots:
        with TemporaryDirectory() as temporary:
            folder = Path(temporary)
            kept = (options.models or folder) / f"{name}.json"
            if not kept.exists():
                write_model(load_robot(name), kept)
            (folder / "arm.json").write_bytes(kept.read_bytes())
            path = make_target_path(name, options.targets)
            path.to_csv(folder / "path.csv", index=False)
            slower = compare_processor()
            runs = [correct(folder) for _ in range(options.runs)]
            slower = 0.5 * (slower + compare_processor())
        line = {
            "robot": name,
            "cpu_s": [round(seconds, 2) for seconds, _ in runs],
            "slower": round(slower, 2),
            "ok": int((runs[0][1]["status"] == OK).sum()),
        }
        print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
