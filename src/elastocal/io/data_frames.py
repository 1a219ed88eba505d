"""Read tables as pandas data frames, and write data frames as CSV, Markdown and LaTeX."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from elastocal.io.atomic_writes import write_text
from elastocal.io.origin import Origin
from elastocal.io.storage import TableSchema, read_provenance, read_table

# Data frames by name.
Frames = Mapping[str, pd.DataFrame]


def read_frame(
    path: str | Path, schema: TableSchema, columns: Sequence[str] | None = None
) -> pd.DataFrame:
    """Read a table as a data frame, checked as in `storage.read_blocks`."""
    return pd.DataFrame(read_table(path, schema, columns))


def read_robot_tables(paths: Iterable[str | Path], schema: TableSchema) -> pd.DataFrame:
    """Read tables of several robots into one frame.

    The first column is the name of the robot, followed by ``noise_um`` and ``strategy``
    (its name) if the table belongs to a strategy.

    Parameters
    ----------
    paths : files of the tables.
    schema : schema for any number of joints. Columns of joints that a robot lacks are
        empty.
    """
    frames = []
    for path in paths:
        provenance = read_provenance(path)
        configuration = provenance["configuration"]
        columns = {"robot": provenance["robot"]}
        if "strategy" in configuration:
            columns["noise_um"] = float(provenance["noise"])
            columns["strategy"] = configuration["strategy"]["name"]
        study = configuration if "robot" in configuration else configuration["study"]
        joints = len(study["robot"]["compliance_urad_per_Nm"])
        frames.append(
            pd.DataFrame({**columns, **read_table(path, schema.for_joints(joints))})
        )
    if not frames:
        return pd.DataFrame({"robot": [], "noise_um": [], "strategy": []})
    return pd.concat(frames, ignore_index=True)


def write_csv(path: str | Path, frame: pd.DataFrame, digits: int = 9) -> None:
    """Write a data frame atomically, with so many significant digits."""
    number_format = f"%.{digits}g"
    # pandas formats floats one by one through several functions, which takes longer than
    # the rest of a table.
    formatted = frame.copy(deep=False)
    for name in frame.select_dtypes(float):
        formatted[name] = [
            "" if math.isnan(number) else number_format % number
            for number in frame[name].tolist()
        ]
    write_text(path, formatted.to_csv(index=False, lineterminator="\n"))


def write_markdown(
    path: str | Path, frame: pd.DataFrame, origin: Origin | None = None
) -> None:
    """Write a frame of strings as a Markdown table; a comment below states its origin."""
    text = frame.to_markdown(index=False, disable_numparse=True) + "\n"
    if origin:
        text += f"\n<!-- {origin.words} -->\n"
    write_text(path, text)


def write_latex(
    path: str | Path, frame: pd.DataFrame, origin: Origin | None = None
) -> None:
    """Write a frame of strings as a LaTeX tabular; a comment below states its origin."""
    text = frame.to_latex(index=False, escape=True, column_format="l" * frame.shape[1])
    if origin:
        text += f"% {origin.words}\n"
    write_text(path, text)
