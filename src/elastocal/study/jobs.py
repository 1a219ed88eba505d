"""What the questions of the study share: the robot and the strategies of a rule, and
tables of every robot as data frames.

Functions that make a data frame import pandas themselves, because most jobs make none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from elastocal.io.origin import PARAMETERS_OF_EVERY_RULE, describe_provenance
from elastocal.mechanics.robot import set_target_offset
from elastocal.mechanics.robot_file import parse_robot
from elastocal.study.strategies import strategy_from_document

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    import pandas as pd

    from elastocal.io.data_frames import Frames
    from elastocal.io.storage import TableSchema
    from elastocal.mechanics.robot import Robot
    from elastocal.study.strategies import Strategy

MICRO = 1e6
MILLI = 1e3


class Job(Protocol):
    """What Snakemake hands to a step; the rule names the members of each attribute."""

    input: Any
    output: Any
    params: Any
    wildcards: Any


def collect_provenance(job: Job) -> dict[str, Any]:
    """Provenance of a file whose robot, noise or strategy the rule's wildcards name."""
    return describe_provenance(job.params, **dict(job.wildcards))


def load_robot(job: Job) -> Robot:
    """Load the robot of a rule with the offset of its targets (interpretation R5)."""
    return set_target_offset(parse_robot(job.params.robot), job.params.tool_offset_m)


def load_strategies(job: Job) -> list[Strategy]:
    """Load the strategies of a rule, in its order."""
    return [strategy_from_document(document) for document in job.params.strategies]


def read_frames(
    job: Job, files: Iterable[str], schema: TableSchema
) -> dict[str, pd.DataFrame]:
    """Read the table of each robot of a rule."""
    from elastocal.io.data_frames import read_frame

    return {
        robot: read_frame(path, schema)
        for robot, path in zip(job.params.robots, files, strict=True)
    }


def concatenate_robots(frames: Frames) -> pd.DataFrame:
    """Join the tables of all robots, with the name of the robot as first column."""
    import pandas as pd

    joined = pd.concat(frames, names=["robot"])
    return joined.reset_index("robot").reset_index(drop=True)


def make_frame(rows: Sequence[Any], columns: Sequence[str] = ()) -> pd.DataFrame:
    """Make a data frame of rows; name the columns of a table that may have no rows."""
    import pandas as pd

    return pd.DataFrame(rows, columns=[*columns] or None)


def add_slugs(frame: pd.DataFrame, slugs: Mapping[str, str]) -> pd.DataFrame:
    """Add a column with the file names of the strategies next to their names.

    `slugs` are file names by the names of strategies.
    """
    extended = frame.copy()
    position = [*frame.columns].index("strategy") + 1
    extended.insert(position, "strategy_file", frame.strategy.map(slugs))
    return extended


def collect_settings(job: Job, *excluded: str) -> dict[str, Any]:
    """Collect the parameters of a rule, without those that every rule has and without the
    excluded ones."""
    return {
        name: value
        for name, value in job.params.items()
        if name not in (*PARAMETERS_OF_EVERY_RULE, *excluded)
    }


def define_table_step(
    schema: TableSchema, make_table: Callable[..., pd.DataFrame]
) -> Callable[[Job], None]:
    """Define a step that makes one table of all robots.

    Parameters
    ----------
    schema
        Of the tables of single robots, the rule's first input.
    make_table
        Called with the table of each robot and, by name, the rule's parameters.
    """

    def step(job: Job) -> None:
        files = job.input[next(iter(job.input.keys()))]
        frames = read_frames(job, files, schema)
        write_csvs(job, table=make_table(frames, **collect_settings(job, "robots")))

    return step


def read_printed_figures(path: str) -> pd.DataFrame:
    """Read the figures that the paper prints."""
    import pandas as pd

    return pd.read_csv(path, dtype={"table": str}, keep_default_na=False)


def write_csvs(job: Job, **tables: pd.DataFrame) -> None:
    """Write tables for people, by the names of the rule's outputs."""
    from elastocal.io.data_frames import write_csv

    for name, table in tables.items():
        write_csv(job.output[name], table)
