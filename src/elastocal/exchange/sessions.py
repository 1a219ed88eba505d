"""Join the files of several sessions, between which a tracker was moved, into one table
of measurements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from elastocal.campaigns.measurements import CONDITIONS
from elastocal.campaigns.tables import read_text_table
from elastocal.errors import InputError
from elastocal.exchange.joining import refuse_unmeasured_rows
from elastocal.exchange.measurement_table import (
    ImportedMeasurements,
    ImportOptions,
    OtherFile,
    read_measurement_table,
)
from elastocal.mechanics.robot import Robot


def read_sessions(
    paths: Sequence[Path],
    options: ImportOptions,
    robot: Robot | None = None,
    joint_file: OtherFile | None = None,
) -> ImportedMeasurements:
    """Read measurements of one file, or of several, each a session of its own.

    Parameters
    ----------
    paths : files, which are read alike.
    options, robot, joint_file : as for `read_measurement_table`. Together the files
        must have all rows of a planned sheet.

    Raises
    ------
    InputError
        Whatever a single file is refused for; or files have different columns.
    """
    if len(paths) == 1:
        return read_measurement_table(paths[0], options, robot, joint_file)
    if joint_file is not None:
        joint_file = replace(joint_file, is_partial=True)
    sessions = [
        read_measurement_table(path, options, robot, joint_file) for path in paths
    ]
    table = _join_tables(paths, [session.table for session in sessions])
    if joint_file is not None and joint_file.is_sheet and not options.skip_empty:
        sheet = read_text_table(joint_file.path, lambda cells: "pose" in cells)
        refuse_unmeasured_rows(sheet, table, ", ".join(path.name for path in paths))
    notes = [f"each of {len(paths)} files is a session of its own"]
    for session in sessions:
        notes += [note for note in session.notes if note not in notes]
    return replace(
        sessions[0],
        table=table,
        skipped=sum(session.skipped for session in sessions),
        notes=tuple(notes),
    )


def _join_tables(
    paths: Sequence[Path], tables: Sequence[dict[str, np.ndarray]]
) -> dict[str, np.ndarray]:
    """Join the tables of several files, and number the sessions if no column does.

    A time or a temperature that not all files have is left out.
    """
    names = [set(table) for table in tables]
    common = set.intersection(*names)
    for path, present in zip(paths, names, strict=True):
        different = sorted(present - common - {*CONDITIONS})
        if different:
            finding = f"columns that other files lack: {', '.join(different)}"
            raise InputError(path, "header", finding, "the same columns in all files")
    joined = {}
    for name in tables[0]:
        if name in common:
            joined[name] = np.concatenate([table[name] for table in tables])
    if "session" not in joined:
        sizes = [len(table["pose"]) for table in tables]
        joined["session"] = np.repeat(np.arange(len(paths)), sizes)
    return joined
