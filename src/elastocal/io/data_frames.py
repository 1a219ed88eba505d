"""Tables on disk as pandas data frames, and data frames as the tables that people read."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import pandas as pd

from elastocal.io.atomic_writes import write_text
from elastocal.io.origin import Origin
from elastocal.io.storage import TableSchema, read_provenance, read_table


def read_frame(path: str | Path, schema: TableSchema, columns: Sequence[str] | None = None) -> pd.DataFrame:
    """A table as a data frame, checked as in `storage.read_blocks`."""
    return pd.DataFrame(read_table(path, schema, columns))


def read_long(paths: Iterable[str | Path], schema: Callable[[int], TableSchema]) -> pd.DataFrame:
    """Tables of many strategies in one frame, headed by robot, noise_um and strategy (its name, not that of its file).

    `schema` is that of a number of joints; columns of joints that a robot lacks are empty.
    """
    frames = [pd.DataFrame({"robot": [], "noise_um": [], "strategy": []})]
    for path in paths:
        origin = read_provenance(path)
        joints = len(origin["configuration"]["robot"]["compliance_urad_per_Nm"])
        heads = {
            "robot": origin["robot"],
            "noise_um": float(origin["noise"]),
            "strategy": origin["configuration"]["strategy"]["name"],
        }
        frames.append(pd.DataFrame(heads | read_table(path, schema(joints))))
    return pd.concat(frames[1:] or frames, ignore_index=True)


def read_studies(paths: Iterable[str | Path], schema: Callable[[int], TableSchema]) -> pd.DataFrame:
    """Tables of further studies, one at least, in one frame, headed by the robot that their provenance says."""
    frames = []
    for path in paths:
        origin = read_provenance(path)
        joints = len(origin["configuration"]["study"]["robot"]["compliance_urad_per_Nm"])
        frames.append(pd.DataFrame({"robot": origin["robot"]} | read_table(path, schema(joints))))
    return pd.concat(frames, ignore_index=True)


def write_csv(path: str | Path, frame: pd.DataFrame, digits: int = 9) -> None:
    """Write a data frame with so many significant digits; the file appears whole or not at all."""
    write_text(path, frame.to_csv(index=False, float_format=f"%.{digits}g", lineterminator="\n"))


def write_markdown(path: str | Path, frame: pd.DataFrame, origin: Origin | None = None) -> None:
    """Write a frame of strings as a Markdown table, with its origin in a comment behind it."""
    named = f"\n<!-- {origin.words} -->\n" if origin else ""
    write_text(path, frame.to_markdown(index=False, disable_numparse=True) + "\n" + named)


def write_latex(path: str | Path, frame: pd.DataFrame, origin: Origin | None = None) -> None:
    """Write a frame of strings as a LaTeX tabular, with its origin in a comment behind it."""
    shown = frame.rename(columns=_latex).map(_latex)
    named = f"% {origin.words}\n" if origin else ""
    write_text(path, shown.to_latex(index=False, column_format="l" * shown.shape[1]) + named)


def _latex(text: str) -> str:
    for plain, escaped in (("_", r"\_"), ("%", r"\%"), ("±", r"$\pm$"), ("µ", r"\textmu{}")):
        text = str(text).replace(plain, escaped)
    return text
