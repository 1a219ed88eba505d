"""Folders with the few files that a check of an audit reads, made without a run, with
planted errors and forged checksums."""

import contextlib
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pinocchio as pin
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from elastocal.io.origin import Origin
from elastocal.io.records import JobRecord, write_records
from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.finished_run import (
    COMPONENTS,
    WRENCH,
    FinishedRun,
    open_philox_stream,
)

_DOCUMENTS = yaml.safe_load(
    Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8")
)
ROBOT, STRATEGY, CONFIGURATION = (
    _DOCUMENTS[name] for name in ("robot", "strategy", "configuration")
)


DATA_SETS = 4
CONFIGURATIONS = 5
POINT = "hand"


def draw_numbers(purpose, data_set):
    """Open the stream of random numbers for one purpose of one data set."""
    return open_philox_stream(1, "two", purpose, data_set)


def deflect(arm, joint_angles, wrench):
    """Return translation and rotation vector of the point under a load."""
    loaded_angles = arm.deflect(arm.springs, joint_angles, wrench, 1)[0]
    position, rotation = arm.pose(joint_angles, POINT)
    loaded_position, loaded_rotation = arm.pose(loaded_angles, POINT)
    return [*(loaded_position - position), *pin.log3(loaded_rotation @ rotation.T)]


def simulate_data_set(arm, data_set):
    """Simulate the configurations of one data set.

    Returns lists of the same length: joint angles and wrenches, exact deflections,
    noise, and estimates from the configurations so far.
    """
    shape = CONFIGURATIONS, 2
    uniform = draw_numbers("identification/joint angles", data_set).random(shape)
    normal = draw_numbers("identification/force", data_set).standard_normal(
        (CONFIGURATIONS, 3)
    )
    noise = 1e-4 * draw_numbers(f"noise/{POINT}", data_set).standard_normal(
        (CONFIGURATIONS, 6)
    )
    states = []
    deflections = []
    regressors = []
    estimates = []
    for joint_angles, direction in zip(
        2 * np.pi * uniform - np.pi, normal, strict=True
    ):
        force = 500 * direction / np.linalg.norm(direction)
        wrench = np.concatenate([force, np.cross([0, 0.5, 0], force)])
        states.append([*joint_angles, *wrench])
        deflections.append(deflect(arm, joint_angles, wrench))
        regressors.append(arm.regressor(joint_angles, wrench, POINT))
        measured = np.array(deflections) + noise[: len(deflections)]
        estimates.append(
            np.linalg.lstsq(
                np.concatenate(regressors), np.concatenate(measured), rcond=None
            )[0]
        )
    return states, deflections, noise, estimates


def make_run(folder):
    """Write experiments, exact and noisy deflections and estimates of one robot, by
    pinocchio; return the finished run."""
    arm = Arm(ROBOT)
    data_sets = [simulate_data_set(arm, data_set) for data_set in range(DATA_SETS)]
    states, deflections, noise, estimates = (
        np.concatenate(arrays) for arrays in zip(*data_sets, strict=True)
    )
    keys = pd.DataFrame(
        {
            "data_set": np.arange(DATA_SETS).repeat(CONFIGURATIONS),
            "configuration": np.tile(np.arange(CONFIGURATIONS), DATA_SETS),
        }
    )
    data = folder / "data/simulated/two"
    (data / "100um").mkdir(parents=True)
    keys.join(pd.DataFrame(states, columns=["q1", "q2", *WRENCH])).to_parquet(
        data / "experiments.parquet"
    )
    for name, values in (
        ("ideal", deflections),
        ("100um/measured", deflections + noise),
    ):
        columns = dict(zip(COMPONENTS, values.T, strict=True))
        keys.assign(point=POINT, **columns).to_parquet(data / f"{name}.parquet")
    results = folder / "results/identified/two/100um"
    results.mkdir(parents=True)
    lengths = keys[["data_set"]].assign(length=keys["configuration"] + 1)
    compliances = ["compliance_1", "compliance_2"]
    lengths.join(pd.DataFrame(estimates, columns=compliances)).to_parquet(
        results / f"{POINT}.parquet"
    )
    return FinishedRun(folder, CONFIGURATION, {"two": ROBOT}, {POINT: STRATEGY}, 20)


def forge(folder, file):
    """Record the checksum of a file as if a job had written it."""
    with contextlib.chdir(folder):
        write_records(
            JobRecord(
                "forged", {}, "", "", {}, (), (file,), Origin("c0ffee", "d16e57", 1), {}
            )
        )


@contextlib.contextmanager
def altered(folder, file, address, change):
    """Change a value of a file, and forge the checksum of the file, during a block.

    The address of a value is a list of keys in a document, or column and row in a
    table.
    """
    paths = [folder / file, folder / f"results/records/{file}.json"]
    before = [path.read_bytes() if path.is_file() else None for path in paths]
    if file.endswith(".json"):
        document = inner = json.loads(before[0])
        *parents, last = address
        for key in parents:
            inner = inner[key]
        inner[last] = change(inner[last])
        paths[0].write_text(json.dumps(document), encoding="utf-8")
    elif file.endswith(".csv"):
        table = pd.read_csv(paths[0])
        column, row = address
        address = table.index[row], column
        table.loc[address] = change(table.loc[address])
        table.to_csv(paths[0], index=False)
    else:
        table = pq.ParquetFile(paths[0]).read()
        column, row = address
        values = table.column(column).to_numpy().copy()
        values[row] = change(values[row])
        field = table.schema.get_field_index(column)
        pq.write_table(
            table.set_column(
                field,
                table.schema.field(field),
                pa.array(values, table.schema.types[field]),
            ),
            paths[0],
        )
    forge(folder, file)
    try:
        yield
    finally:
        for path, content in zip(paths, before, strict=True):
            path.unlink() if content is None else path.write_bytes(content)


def failed(findings):
    """List the names of the checks that failed."""
    return [finding.checked for finding in findings if not finding.holds]
