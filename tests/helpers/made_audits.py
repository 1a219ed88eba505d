"""A folder with the few files that a check of an audit reads, made without a run."""

import numpy as np
import pandas as pd

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.audited import COMPONENTS, WRENCH, Audited
from elastocal_proof.audit.streams import numbers

ROBOT = {
    "name": "two joints",
    "chain": "Tz(0.4) Rz(q1) Tx(0.1) Ry(q2) Tx(0.7) [hand]",
    "joint_limits_deg": [[-90, 90], [-90, 90]],
    "compliance_urad_per_Nm": [0.5, 0.8],
}
STRATEGY = {"name": "hand alone", "stages": [{"points": ["hand"], "joints": [1, 2]}]}
CONFIGURATION = {
    "seed": 1,
    "robots": ["two"],
    "strategies": ["hand"],
    "noise_um": [0, 100],
    "data_sets": 4,
    "configurations": 5,
    "test_configurations": 6,
    "loading": {"force_N": 500.0, "offset_m": [0, 0.5, 0]},
    "interpretations": {
        **{"joint_range": "full_turn", "offset_frame": "base", "measured": "pose", "tool_offset_m": [0, 0, 0]},
        **{"wrench_at": "end_effector", "average": "stiffness", "deviation_of": "averaged_model"},
    },
    "identification": {"solver": "equation_11", "start_urad_per_Nm": 1},
    "evaluation": {"bootstrap_replicates": 10, "lengths": [5]},
    "tables": {"noise_um": 100, "length": 5},
    "questions": {},
}


def made_run(folder):
    """Experiments, exact and noisy deflections of one robot, by pinocchio."""
    run = Audited(folder, CONFIGURATION, {"two": ROBOT}, {"hand": STRATEGY}, 4)
    arm = Arm(ROBOT)
    for test, sets, count in (("", 4, 5), ("/test", 1, 6)):
        purpose = "test" if test else "identification"
        rows, moved = [], []
        for data_set in range(sets):
            turns = numbers(1, "two", f"{purpose}/joint angles", data_set).random((count, 2))
            normal = numbers(1, "two", f"{purpose}/force", data_set).standard_normal((count, 3))
            for k, (q, f) in enumerate(zip(2 * np.pi * turns - np.pi, normal, strict=True)):
                force = 500 * f / np.linalg.norm(f)
                wrench = np.concatenate([force, np.cross([0, 0.5, 0], force)])
                rows.append([data_set, k, *q, *wrench])
                moved.append([data_set, k, *arm.deflection(q, wrench, "hand", "end_effector")])
        place = folder / f"data/simulated/two{test}"
        place.mkdir(parents=True, exist_ok=True)
        names = ["data_set", "configuration"]
        pd.DataFrame(rows, columns=[*names, "q1", "q2", *WRENCH]).to_parquet(place / "experiments.parquet")
        ideal = pd.DataFrame(moved, columns=[*names, *COMPONENTS]).assign(point="hand")
        ideal.to_parquet(place / "ideal.parquet")
    (folder / "data/simulated/two/100um").mkdir()
    noise = np.concatenate([numbers(1, "two", "noise/hand", k).standard_normal((5, 6)) for k in range(4)])
    clean = pd.read_parquet(folder / "data/simulated/two/ideal.parquet")
    clean[list(COMPONENTS)] += 1e-4 * noise
    clean.to_parquet(folder / "data/simulated/two/100um/measured.parquet")
    return run


def altered(run, file, column, row, by):
    """Add to one value of a file, and read it again."""
    frame = pd.read_parquet(run.folder / file)
    frame.loc[row, column] += by
    frame.to_parquet(run.folder / file)
    for kept in (run.table, run.experiments, run.deflections):
        kept.cache_clear()


def failed_table(run, room, name, table):
    """What of a table of the study does not hold once it is written; `room`: the module that follows it."""
    file = f"reports/tables/{name}.csv"
    (run.folder / file).parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(run.folder / file, index=False)
    return failed(room.tables(run, file, name))


def failed(findings):
    """What of the findings does not hold."""
    return [finding.checked for finding in findings if not finding.holds]
