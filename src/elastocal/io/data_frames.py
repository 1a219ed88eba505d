"""Tables on disk as pandas data frames, and data frames as the tables that people
read."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import pandas as pd

from elastocal.io.atomic_writes import write_text
from elastocal.io.origin import Origin
from elastocal.io.storage import TableSchema, read_provenance, read_table


def read_frame(
    path: str | Path, schema: TableSchema, columns: Sequence[str] | None = None
) -> pd.DataFrame:
    """A table as a data frame, checked as in `storage.read_blocks`."""
    return pd.DataFrame(read_table(path, schema, columns))


def read_robot_tables(
    paths: Iterable[str | Path], schema: Callable[[int], TableSchema]
) -> pd.DataFrame:
    """Tables of many robots in one frame, headed by the robot, and by noise_um and
    strategy (its name) where they are of one.

    `schema` is that of a number of joints; columns of joints that a robot lacks are
    empty.
    """
    frames = []
    for path in paths:
        origin = read_provenance(path)
        settings = origin["configuration"]
        heads = {"robot": origin["robot"]}
        if "strategy" in settings:
            heads |= {
                "noise_um": float(origin["noise"]),
                "strategy": settings["strategy"]["name"],
            }
        robot = settings["robot"] if "robot" in settings else settings["study"]["robot"]
        columns = read_table(path, schema(len(robot["compliance_urad_per_Nm"])))
        frames.append(pd.DataFrame({**heads, **columns}))
    return pd.concat(
        frames or [pd.DataFrame({"robot": [], "noise_um": [], "strategy": []})],
        ignore_index=True,
    )


def write_csv(path: str | Path, frame: pd.DataFrame, digits: int = 9) -> None:
    """Write a data frame with so many significant digits; the file appears whole or not
    at all."""
    write_text(
        path,
        frame.to_csv(index=False, float_format=f"%.{digits}g", lineterminator="\n"),
    )


def write_markdown(
    path: str | Path, frame: pd.DataFrame, origin: Origin | None = None
) -> None:
    """Write a frame of strings as a Markdown table, with its origin in a comment behind
    it."""
    named = f"\n<!-- {origin.words} -->\n" if origin else ""
    write_text(
        path, frame.to_markdown(index=False, disable_numparse=True) + "\n" + named
    )


def write_latex(
    path: str | Path, frame: pd.DataFrame, origin: Origin | None = None
) -> None:
    """Write a frame of strings as a LaTeX tabular, with its origin in a comment behind
    it."""
    named = f"% {origin.words}\n" if origin else ""
    write_text(
        path,
        frame.to_latex(index=False, escape=True, column_format="l" * frame.shape[1])
        + named,
    )
