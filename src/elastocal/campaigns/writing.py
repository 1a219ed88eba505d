"""Write the folder of a campaign atomically, and templates of ``campaign.yaml`` and of
a sheet."""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from elastocal.campaigns.campaign import (
    DEFAULT_HOLDOUT,
    DOCUMENT,
    GEOMETRY,
    ROBOT_FILE,
)
from elastocal.campaigns.measurements import (
    CSV,
    PARQUET,
    check_column_names,
    describe_columns,
    write_measurements,
)
from elastocal.io.atomic_writes import write_text, write_together
from elastocal.io.documents import (
    LARGEST_BYTES,
    check_document,
    format_one_line,
    read_schema,
)
from elastocal.io.texts import read_text
from elastocal.mechanics.robot import Robot


def write_campaign(
    folder: str | Path,
    document: Mapping[str, Any],
    table: Mapping[str, Sequence[Any] | np.ndarray],
    joints: int,
    kind: str = "parquet",
) -> None:
    """Write a campaign's folder atomically, ``campaign.yaml`` last.

    Parameters
    ----------
    folder : made if it does not exist.
    document : contents of ``campaign.yaml``.
    table : columns of one length, named as in `describe_columns`.
    joints : number of joints of the robot.
    kind : "parquet" or "csv".

    Raises
    ------
    InputError
        If the schema refuses the document, or the format does not have a column.
    """
    folder = Path(folder)
    check_document(document, "campaign", (folder / DOCUMENT).as_posix())
    path = folder / (PARQUET if kind == "parquet" else CSV)
    check_column_names(table, joints, path.as_posix())
    # The document is written last, because a folder without it is no campaign. Old
    # measurements of the other kind are removed.
    with write_together(folder, (CSV, PARQUET, DOCUMENT)) as partial:
        write_measurements(partial / path.name, table, joints)
        text = yaml.safe_dump(
            document,
            sort_keys=False,
            allow_unicode=True,
            default_flow_style=None,
            width=120,
        )
        write_text(partial / DOCUMENT, text)


def copy_robot_file(robot_file: str | Path, folder: str | Path) -> None:
    """Copy a robot file into the folder of a campaign, which is made if it does not
    exist."""
    text = read_text(robot_file, LARGEST_BYTES)
    Path(folder).mkdir(parents=True, exist_ok=True)
    # The old file stays until the new one takes its name in one step.
    write_text(Path(folder) / ROBOT_FILE, text)


def format_campaign_template(
    name: str, robot: Robot, targets: Sequence[str] = (), measured: str = "position"
) -> str:
    """Return the text of a campaign.yaml to fill in, with every key explained; optional
    keys are comments.

    Parameters
    ----------
    name : name of the campaign.
    robot : robot of the file robot.yaml in the same folder.
    targets, measured : as in the measurements of the folder.
    """
    end_effector = robot.chain.end_effector.name
    document = {
        "campaign": name,
        "robot": ROBOT_FILE,
        "measured": measured,
        "frame": "tracker",
        "targets": {
            target: {"point": end_effector, "offset_m": "unknown"}
            for target in targets or ("reflector",)
        },
        "compliance": "nominal" if robot.compliance_known else "identify",
        "declared": [*GEOMETRY],
        "holdout": DEFAULT_HOLDOUT,
    }
    schema = read_schema("campaign")
    text = f"# {schema['title']}. Keys behind # are optional.\n"
    for key, rule in schema["properties"].items():
        meaning = textwrap.fill(
            rule.get("description", key),
            110,
            initial_indent="# ",
            subsequent_indent="# ",
        )
        if key in document:
            entry = f"{key}: {format_one_line(document[key])}"
        else:
            entry = f"# {key}: {format_one_line(rule['examples'][0])}"
        text += f"\n{meaning}\n{entry}\n"
    return text


# Beginnings of the names of optional columns, which a sheet to fill in does not have.
_OPTIONAL_COLUMNS = (
    "session",
    "approach",
    "time_s",
    "temperature_c",
    "u95_m",
    "rx",
    "ry",
    "rz",
    "kind",
    "feature",
    "value",
)


def format_sheet_header(joints: int) -> str:
    """Return the header of a measurements.csv to fill in, without optional columns."""
    names = [
        name
        for name in describe_columns(joints)
        if not name.startswith(_OPTIONAL_COLUMNS)
    ]
    return ",".join(names) + "\n"
