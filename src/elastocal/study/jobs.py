"""What questions of the study share: how they declare tables, the robot of a rule,
tables of every robot in frames.

Pandas is imported where a frame is made: most jobs make none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from elastocal.io.origin import SOURCES_DIGEST, STEP, describe_provenance
from elastocal.io.storage import Column, TableSchema
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.strategies import strategy_from_document

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    import pandas as pd

    from elastocal.mechanics.robot import Robot
    from elastocal.study.strategies import Strategy

MICRO = 1e6
MILLI = 1e3


def make_schema(name: str, *columns: Column) -> TableSchema:
    """A table: its name and its columns with units and meanings, written down beside
    the function that fills it."""
    return TableSchema(name, columns)


def make_real_column(
    name: str,
    unit: str,
    meaning: str,
    missing: bool = False,
    minimum: float | None = None,
) -> Column:
    """Numbers; `missing`: some may be not a number or infinite."""
    return Column(name, "float64", unit, meaning, missing, minimum)


def make_integer_column(name: str, meaning: str, minimum: int | None = None) -> Column:
    """Counts and numbers of things."""
    return Column(name, "int32", "", meaning, minimum=minimum)


def make_group_column(name: str, meaning: str) -> Column:
    """A word that is the same in a whole row group."""
    return Column(name, "string", "", meaning)


DATA_SET = make_integer_column("data_set", "number of the data set, from 0", 0)
CONFIGURATION = make_integer_column(
    "configuration", "number of the configuration in its data set, from 0", 0
)
LENGTH = make_integer_column(
    "length",
    "data set length ds: how many configurations, from the first, were used",
    1,
)
STRATEGY = make_group_column("strategy", "name of the strategy; a row group holds one")
MEAN_SQUARE_MEANING = "mean square end-effector error on test configurations"
MEAN_SQUARE = make_real_column("mean_square", "m^2", MEAN_SQUARE_MEANING, missing=True)


class Job(Protocol):
    """What Snakemake hands to a step; the names in each part are the rule's."""

    input: Any
    output: Any
    params: Any
    wildcards: Any


def collect_provenance(job: Job) -> dict[str, Any]:
    """Provenance of a file of one robot, noise or strategy, which its wildcards are."""
    return describe_provenance(job.params, **dict(job.wildcards))


def load_robot(job: Job) -> Robot:
    """The robot of a rule with the offset of its targets (interpretation R5)."""
    return with_target_offset(
        robot_from_document(job.params.robot), job.params.tool_offset_m
    )


def load_strategies(job: Job) -> list[Strategy]:
    """The strategies of a rule, in its order."""
    return [strategy_from_document(document) for document in job.params.strategies]


def read_frames(
    job: Job, files: Iterable[str], schema: TableSchema
) -> dict[str, pd.DataFrame]:
    """The table of each robot of a rule."""
    from elastocal.io.data_frames import read_frame

    return {
        robot: read_frame(path, schema)
        for robot, path in zip(job.params.robots, files, strict=True)
    }


def concatenate_robots(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """The tables of all robots one below the other, with the name of the robot in
    front."""
    import pandas as pd

    return pd.concat(found, names=["robot"]).reset_index("robot").reset_index(drop=True)


def make_frame(rows: Sequence[Any], columns: Sequence[str] = ()) -> pd.DataFrame:
    """Rows as a data frame; `columns`: those of a table that may have no rows."""
    import pandas as pd

    return pd.DataFrame(rows, columns=[*columns] or None)


def add_slugs(frame: pd.DataFrame, slugs: Mapping[str, str]) -> pd.DataFrame:
    """A table with the names of the strategies' files, `slugs` by the names of
    strategies, behind these."""
    found = frame.copy()
    found.insert(
        [*frame.columns].index("strategy") + 1,
        "strategy_file",
        frame.strategy.map(slugs),
    )
    return found


def collect_settings(job: Job, *others: str) -> dict[str, Any]:
    """Parameters of a rule but for those that are of every rule, and others."""
    return {
        name: value
        for name, value in job.params.items()
        if name not in (STEP, SOURCES_DIGEST, *others)
    }


def define_table_step(
    schema: TableSchema, make: Callable[..., pd.DataFrame]
) -> Callable[[Job], None]:
    """A step of all robots: `make` has the table of each, of the rule's first input,
    and by their names its parameters."""

    def step(job: Job) -> None:
        files = job.input[next(iter(job.input.keys()))]
        write_csvs(
            job,
            table=make(
                read_frames(job, files, schema), **collect_settings(job, "robots")
            ),
        )

    return step


def read_printed_figures(path: str) -> pd.DataFrame:
    """The printed figures."""
    import pandas as pd

    return pd.read_csv(path, dtype={"table": str}, keep_default_na=False)


def write_csvs(job: Job, **found: pd.DataFrame) -> None:
    """Tables for people, by the names of the rule's outputs."""
    from elastocal.io.data_frames import write_csv

    for name, frame in found.items():
        write_csv(job.output[name], frame)
