"""Small campaigns of the plant, diagnosed, with their files where the pipeline puts them, and what an audit finds in these."""

import json
import sys
from contextlib import contextmanager

import pandas as pd
from analysed_robots import ROBOTS
from made_audits import CONFIGURATION, failed

from elastocal.campaigns.columns import columns_of
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import residual_blocks, split_table
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.case import case_from
from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import write_json
from elastocal.io.storage import read_table, write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop import schemas
from elastocal.loop.loading import load_campaign
from elastocal.loop.whole import judged
from elastocal_proof.audit.audited import Audited
from elastocal_proof.audit.whole import checks_of
from elastocal_proof.blind.folders import write_blind_campaign
from elastocal_proof.plant.arm import arm_from_file
from elastocal_proof.plant.campaigns import Design, schedule_of
from elastocal_proof.plant.defects import drawn_defect, with_defects
from elastocal_proof.plant.physical_robot import specimen
from elastocal_proof.plant.weights import declared_masses

USUAL = {"poses": 12, "held_out": 4, "ladder": (0.0, 1.0, -1.0), "repeats": 3, "repeated_poses": 4, "points": ("flange",)}


def diagnosed_campaign(top, robot, effects=(), weighs=False, **design):
    """Measure a robot with some defects, diagnose it, and write all files of the loop below `top`: the campaign `cell`."""
    file, planned = ROBOTS / f"{robot}.yaml", Design(**USUAL | design)
    arm = arm_from_file(file)
    bad = with_defects(specimen(arm, 4, weighs=weighs), [drawn_defect(effect, arm, 4) for effect in effects])
    declared = declared_masses(arm) if weighs else ()
    write_blind_campaign(top / "cell", "cell", file, bad, planned, schedule_of(arm, planned, 3), declared)
    results, reports = top / "results/loop/cell", top / "reports/loop/cell"
    results.mkdir(parents=True)
    reports.mkdir(parents=True)
    descriptions, *parts = load_campaign(top / "cell", ROBOTS)
    for name, part in zip(("training", "held_out"), parts, strict=True):
        write_table(results / f"{name}.parquet", schemas.measurements(arm.joints), [columns_of(part)], {})
    write_json(results / "campaign.json", descriptions)
    case, unseen = (case_from(descriptions, columns_of(part)) for part in parts)
    found = diagnose(case, Settings(), 1)
    write_json(results / "diagnosis.json", tables.diagnosis_facts(found))
    write_table(results / "steps.parquet", schemas.STEPS, tables.step_blocks(found), {})
    write_table(results / "correlations.parquet", schemas.CORRELATIONS, [tables.final_correlations(found)], {})
    write_table(results / "models.parquet", schemas.MODELS, [tables.model_columns(found)], {})
    write_table(results / "confounding.parquet", schemas.CONFOUNDING, [tables.confounding_columns(found)], {})
    # As the next job does: from the files.
    steps = read_table(results / "steps.parquet", schemas.STEPS)
    again = tables.diagnosis_from(case, tables.diagnosis_facts(found), steps)
    verdict = judged(again, unseen, 1)
    write_json(reports / "verdict.json", verdict.document, allow_nan=False)
    write_csv(reports / "before_after.csv", pd.DataFrame(verdict.rows))
    write_csv(reports / "splits.csv", pd.DataFrame(split_table(again, verdict.held_out, 1)))
    write_table(reports / "residuals.parquet", schemas.residuals(arm.joints), residual_blocks(again, verdict), {})
    return top


def audit_of(top, *files):
    """Findings of files of the campaign `cell`, all of them by default, every row looked at."""
    run = Audited(top, CONFIGURATION, {}, {}, sys.maxsize)
    files = files or [path.relative_to(top).as_posix() for path in sorted(top.glob("re*/loop/cell/*"))]
    return [finding for file in files for _, check, arguments in checks_of(file) for finding in check(run, file, **arguments)]


@contextmanager
def altered(top, file, at, change):
    """The block finds one value of a file changed: of a document by its keys, of a table by column and row."""
    path = top / file
    before = path.read_bytes()
    if path.suffix == ".json":
        document = inner = json.loads(before)
        *way, last = at
        for key in way:
            inner = inner[key]
        inner[last] = change(inner[last])
        path.write_text(json.dumps(document), encoding="utf-8")
    else:
        column, row = at
        table = pd.read_csv(path) if path.suffix == ".csv" else pd.read_parquet(path)
        table.loc[table.index[row], column] = change(table[column].iloc[row])
        table.to_csv(path, index=False) if path.suffix == ".csv" else table.to_parquet(path)
    try:
        yield
    finally:
        path.write_bytes(before)


def failed_once_altered(top, file, at, change, *audited):
    """What does not hold of some files, the altered one by default."""
    with altered(top, file, at, change):
        return failed(audit_of(top, *(audited or (file,))))
