"""The way from a URDF to a verified robot, without a hand between the commands: each
line that is run is the one that the command before has printed as the next.

The user adds only what nobody else can know: the options of the plan, the units of a
path, and the files that tracker and controller write.
"""

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation
from unseen_cells import Cell, read_program, write_tracker_file

_JOINTS = [f"q{joint}" for joint in range(1, 7)]
_FORCE = ["fx", "fy", "fz"]
_MORNING_S = 9 * 3600.0
_AFTERNOON_S = 13 * 3600.0
_NEXT_DAY_S = 10 * 3600.0


class Replay:
    """A user at a terminal, and the simulated cell.

    Parameters
    ----------
    unseen : Unseen
        The robot.
    folder : path
        Working directory, a checkout.
    offsets : dict
        Reflectors on the flange by their names, (3,), m, as a caliper gives them.
    comma : bool
        Whether tracker and controller write decimal commas.
    """

    def __init__(self, unseen, folder, offsets, *, comma, seed=7):
        self.folder = folder
        self.offsets = offsets
        self.comma = comma
        unseen.write_urdf(folder / "arm.urdf")
        self.cell = Cell(unseen, seed, folder / "arm.urdf")
        self.next = "elastocal import urdf arm.urdf --base base_link --tip flange"
        self.lines = []
        self.codes = []
        self.output = ""

    def follow(self, *options, may_fail=False, files=None):
        """Run the line that the last command has printed, with options that only the
        user knows; `files` replaces the file that the line reads."""
        words = shlex.split(self.next)
        if files:
            place = words.index("tracker.csv")
            words[place : place + 1] = files
        words += options
        environment = os.environ | {
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "OMP_NUM_THREADS": "1",
        }
        done = subprocess.run(
            words, cwd=self.folder, capture_output=True, text=True, env=environment
        )
        self.output = done.stdout + done.stderr
        self.lines.append(shlex.join(words))
        self.codes.append(done.returncode)
        assert done.returncode == 0 or may_fail, f"{self.lines[-1]}\n{self.output}"
        assert "Traceback" not in self.output, self.output
        following = [
            line.removeprefix("next: ")
            for line in self.output.splitlines()
            if line.startswith("next: ")
        ]
        # Before the command stands what is done in the cell.
        _, command, arguments = "".join(following[-1:]).partition("elastocal ")
        self.next = command + arguments
        return self.output

    def measure_sheet(self, campaign):
        """Drive to the planned rows and write the tracker's files: morning.csv and
        afternoon.csv, and both in tracker.csv."""
        sheet = pd.read_csv(self.folder / campaign / "measurements.csv")
        states = sheet.drop_duplicates(["pose", "load", "repeat"])
        angles = np.radians(states[[f"{joint}_deg" for joint in _JOINTS]].to_numpy())
        block = (states["pose"] > states["pose"].median()).to_numpy().astype(int)
        position = self.cell.measure(
            angles, states[_FORCE].to_numpy(), [*self.offsets.values()], block
        )
        labels = [
            (f"P{state.pose:03}", state.load, state.repeat, target)
            for state in states.itertuples()
            for target in self.offsets
        ]
        points = position.reshape(-1, 3)
        later = np.repeat(block, len(self.offsets)) == 1
        names = ["Pose", "Load", "Repeat", "Target"]
        parts = {
            "morning.csv": (~later, _MORNING_S),
            "afternoon.csv": (later, _AFTERNOON_S),
            "tracker.csv": (np.ones(len(points), bool), _MORNING_S),
        }
        for file, (chosen, start_s) in parts.items():
            rows = [labels[row] for row in np.flatnonzero(chosen)]
            self._write(file, rows, points[chosen], start_s, names)

    def write_path(self, ways_deg, count, notation, names, force_N=None):
        """Write path.csv, along straight lines in joint space, as a controller shows
        it: mm, degrees and its own Euler angles.

        `force_N` is the process force (3,) on the flange along the path, base axes.
        """
        ways = np.radians(np.array(ways_deg, float))
        share = np.linspace(0, len(ways) - 1, count)
        angles = np.column_stack(
            [np.interp(share, range(len(ways)), column) for column in ways.T]
        )
        position, rotation = self.cell.follow(angles)
        euler = Rotation.from_matrix(rotation).as_euler(notation, degrees=True)
        mark = ";" if self.comma else ","
        header = ["X", "Y", "Z", *names]
        table = np.column_stack([1e3 * position, euler])
        if force_N is not None:
            header += _FORCE
            table = np.column_stack([table, np.tile(force_N, (count, 1))])
        lines = [mark.join(header)]
        for row in table:
            cells = [f"{value:.4f}" for value in row]
            if self.comma:
                cells = [cell.replace(".", ",") for cell in cells]
            lines.append(mark.join(cells))
        (self.folder / "path.csv").write_text("\n".join(lines) + "\n")

    def measure_targets(self, program):
        """Run the program on the controller and write what the tracker measures,
        measured.csv."""
        angles = read_program(self.folder / program)
        targets = pd.read_csv(self.folder / "targets.csv")
        offsets = [*self.offsets.values()][:1]
        position = self.cell.measure(
            angles, targets[_FORCE].to_numpy(), offsets, np.ones(len(angles), int)
        )
        rows = [(f"P{number:03}",) for number in range(1, len(angles) + 1)]
        names = ["Pose"]
        if len(self.offsets) > 1:
            rows = [(*row, next(iter(self.offsets))) for row in rows]
            names = ["Pose", "Target"]
        self._write("measured.csv", rows, position[:, 0], _NEXT_DAY_S, names)

    def _write(self, file, rows, points, start_s, names):
        write_tracker_file(
            self.folder / file, rows, points, start_s, comma=self.comma, names=names
        )

    def find_true_errors(self, *, base_known, suffix=""):
        """Return the errors (N,) of the flange at the commands of targets.csv, m,
        without noise; after the best placement if the base is unknown.

        `suffix` is "_uncorrected" for the commands without a correction.
        """
        targets = pd.read_csv(self.folder / "targets.csv")
        commands = targets[[f"{joint}{suffix}" for joint in _JOINTS]].to_numpy()
        force = targets[_FORCE].to_numpy()
        position, _ = self.cell.reach(commands, force, repeatable=True)
        wanted = targets[["x", "y", "z"]].to_numpy()
        if not base_known:
            turn, _ = Rotation.align_vectors(
                wanted - wanted.mean(axis=0), position - position.mean(axis=0)
            )
            position = turn.apply(position - position.mean(axis=0))
            position += wanted.mean(axis=0)
        return np.linalg.norm(position - wanted, axis=1)

    def read(self, campaign, name):
        """Return a document of a campaign's report."""
        path = self.folder / "reports" / "loop" / campaign / name
        return json.loads(path.read_text(encoding="utf-8"))
