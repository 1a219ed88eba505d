"""A campaign's folder, written so that it is never half a campaign, and one to begin with: every key explained."""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from elastocal.campaigns.campaign import DOCUMENT
from elastocal.campaigns.measurements import CSV, PARQUET, check_column_names, file_columns, write_measurements
from elastocal.io.atomic_writes import write_text, write_together
from elastocal.io.documents import check_document, one_line, read_schema
from elastocal.mechanics.robot import Robot


def write_campaign(
    folder: str | Path,
    document: Mapping[str, Any],
    table: Mapping[str, Sequence[Any] | np.ndarray],
    joints: int,
    kind: str = "parquet",
) -> None:
    """Write a campaign's folder; each file appears whole or not at all, ``campaign.yaml`` last.

    `folder`: made where it is not there. `document`: contents of ``campaign.yaml``. `table`: columns of one length, named as in
    `file_columns`. `kind`: one of "parquet", "csv". Raises `InputError`: a document that the schema refuses, or a column that
    the format does not have.
    """
    folder = Path(folder)
    check_document(document, "campaign", (folder / DOCUMENT).as_posix())
    path = folder / (PARQUET if kind == "parquet" else CSV)
    check_column_names(table, joints, path.as_posix())
    # Until its document is there the folder is no campaign; nor may it hold measurements of both kinds.
    with write_together(folder, (CSV, PARQUET, DOCUMENT)) as partial:
        write_measurements(partial / path.name, table, joints)
        text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120)
        write_text(partial / DOCUMENT, text)


_WIDTH = 110
# An arm of six joints; its name says that it is nobody's.
_ROBOT: dict[str, Any] = {
    "name": "to be replaced",
    "chain": "Tz(l1) Rz(q1) Tx(l2) Ry(q2) Tx(l3) [2DoF] Ry(q3) Tz(l4) Tx(l5) Rx(q4) [4DoF] Ry(q5) Rx(q6) Tx(l6) [6DoF]",
    "lengths_m": {"l1": 0.675, "l2": 0.35, "l3": 1.15, "l4": -0.041, "l5": 1.2, "l6": 0.24},
    "joint_limits_deg": [[-185, 185], [-140, -5], [-120, 155], [-350, 350], [-122.5, 122.5], [-350, 350]],
}


def campaign_template(name: str, robot: Robot, targets: Sequence[str] = (), measured: str = "position") -> str:
    """Text of a campaign.yaml to fill in.

    `robot`: whose file is robot.yaml beside it. `targets`, `measured`: as the measurements have them that lie there.
    """
    document = {
        "campaign": name,
        "robot": "robot.yaml",
        "measured": measured,
        "frame": "tracker",
        "targets": {t: {"point": robot.chain.end_effector.name, "offset_m": "unknown"} for t in targets or ("reflector",)},
        "compliance": "nominal" if robot.compliance_known else "identify",
        "declared": ["joint_offset", "link_geometry"],
        "holdout": {"fraction": 0.3, "seed": 1},
    }
    return _explain("campaign", document)


def robot_template() -> str:
    """Text of a robot.yaml to replace what is in it."""
    return _explain("robot", _ROBOT)


def sheet_template(joints: int) -> str:
    """Header of a measurements.csv to fill in, without optional covariates."""
    optional = ("session", "approach", "time_s", "temperature_c", "u95_m", "rx", "ry", "rz")
    return ",".join(name for name in file_columns(joints) if not name.startswith(optional)) + "\n"


def _explain(schema: str, document: Mapping[str, Any]) -> str:
    """A document as YAML in which each key of its schema is explained; those that it leaves out stand as comments."""
    lines = [f"# {read_schema(schema)['title']}. Keys behind # are optional."]
    for key, rule in read_schema(schema)["properties"].items():
        meaning = rule.get("description", key)
        lines += ["", *textwrap.wrap(meaning, _WIDTH, initial_indent="# ", subsequent_indent="# ")]
        if key in document:
            lines.append(f"{key}: {one_line(document[key])}")
        else:
            lines.append(f"# {key}: {one_line(rule['examples'][0])}")
    return "\n".join(lines) + "\n"
