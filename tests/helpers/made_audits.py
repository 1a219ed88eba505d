"""Folders with the few files that a check of an audit reads, made without a run; errors
planted into them, checksums forged."""

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

_MADE = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))
ROBOT, STRATEGY, CONFIGURATION = (
    _MADE[name] for name in ("robot", "strategy", "configuration")
)


def make_run(folder):
    """Experiments, exact and noisy deflections and estimates of one robot, by
    pinocchio."""
    arm = Arm(ROBOT)
    place = folder / "data/simulated/two"
    read = ["data_set", "configuration"]
    experiments = []
    deflections = []
    noises = []
    found = []
    for data_set in range(4):
        turns = open_philox_stream(
            1, "two", "identification/joint angles", data_set
        ).random((5, 2))
        normal = open_philox_stream(
            1, "two", "identification/force", data_set
        ).standard_normal((5, 3))
        noise = open_philox_stream(1, "two", "noise/hand", data_set).standard_normal(
            (5, 6)
        )
        matrices = []
        for k, (q, f) in enumerate(zip(2 * np.pi * turns - np.pi, normal, strict=True)):
            force = 500 * f / np.linalg.norm(f)
            wrench = np.concatenate([force, np.cross([0, 0.5, 0], force)])
            still, moved = (
                arm.pose(at, "hand")
                for at in (q, arm.deflect(arm.springs, q, wrench, 1)[0])
            )
            experiments.append([data_set, k, *q, *wrench])
            deflections.append(
                [*(moved[0] - still[0]), *pin.log3(moved[1] @ still[1].T)]
            )
            noises.append(1e-4 * noise[k])
            matrices.append(arm.regressor(q, wrench, "hand"))
            seen = np.concatenate((np.array(deflections) + noises)[-len(matrices) :])
            found.append(
                [
                    data_set,
                    k + 1,
                    *np.linalg.lstsq(np.concatenate(matrices), seen, rcond=None)[0],
                ]
            )
    tables = {
        "experiments": pd.DataFrame(experiments, columns=[*read, "q1", "q2", *WRENCH])
    }
    for name, moved in (
        ("ideal", np.array(deflections)),
        ("100um/measured", np.array(deflections) + noises),
    ):
        tables[name] = tables["experiments"][read].assign(
            point="hand", **dict(zip(COMPONENTS, moved.T, strict=True))
        )
    (place / "100um").mkdir(parents=True)
    for name, table in tables.items():
        table.to_parquet(place / f"{name}.parquet")
    (folder / "results/identified/two/100um").mkdir(parents=True)
    names = ["data_set", "length", "compliance_1", "compliance_2"]
    pd.DataFrame(found, columns=names).to_parquet(
        folder / "results/identified/two/100um/hand.parquet"
    )
    return FinishedRun(folder, CONFIGURATION, {"two": ROBOT}, {"hand": STRATEGY}, 20)


def forge(folder, file):
    """Record a file's checksum as if a job had written it."""
    with contextlib.chdir(folder):
        write_records(
            JobRecord(
                "forged", {}, "", "", {}, (), (file,), Origin("c0ffee", "d16e57", 1), {}
            )
        )


@contextlib.contextmanager
def altered(folder, file, at, change):
    """The block finds a value of a document (by keys) or table (by column and row)
    changed, the checksum of the file forged."""
    paths = [folder / file, folder / f"results/records/{file}.json"]
    before = [path.read_bytes() if path.is_file() else None for path in paths]
    if file.endswith(".json"):
        document = inner = json.loads(before[0])
        *way, last = at
        for key in way:
            inner = inner[key]
        inner[last] = change(inner[last])
        paths[0].write_text(json.dumps(document), encoding="utf-8")
    else:
        table, (column, row) = pq.ParquetFile(paths[0]).read(), at
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
    """What of the findings does not hold."""
    return [finding.checked for finding in findings if not finding.holds]
