"""Rehearse a calibration: a physical robot in simulation, with hidden defects, stands in for a real one.

    python workflow/examples/rehearse.py measure FOLDER                  fills the measurement sheet of a campaign
    python workflow/examples/rehearse.py move FOLDER PATH.csv OUT.csv    goes along a path, uncorrected and corrected

FOLDER is the campaign; PATH.csv has the wanted poses and OUT.csv the joint targets of `elastocal correct`. The robot follows
from the robot file of the campaign, --seed and --effect, and is the same in both.
"""

import pandas as pd

from elastocal.blind.rehearsal import filled_sheet
from elastocal.campaigns.measurements import CSV
from elastocal.io.atomic_writes import atomic_write


def measure(given, robot, document):
    path = given.folder / CSV
    filled = filled_sheet(pd.read_csv(path), document, robot, given.seed, path.as_posix())
    with atomic_write(path) as partial:
        filled.to_csv(partial, index=False)
    print(f"{len(filled)} measurements in {path}")
