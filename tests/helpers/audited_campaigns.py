"""Small campaigns of the plant, diagnosed, with the files that an audit reads, and what
it finds in these."""

from analysed_robots import ROBOTS
from made_audits import CONFIGURATION

from elastocal.campaigns.campaign import tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import generate_residual_blocks
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.model import build_case
from elastocal.io.json_files import write_json
from elastocal.io.storage import write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop import schemas
from elastocal.loop.loading import load_campaign
from elastocal.loop.whole import judged
from elastocal_proof.audit.audited import Audited
from elastocal_proof.audit.whole import checks_of
from elastocal_proof.blind.folders import Experiment, write_blind_campaign
from elastocal_proof.plant.arm import arm_from_file
from elastocal_proof.plant.campaigns import Design, schedule_of
from elastocal_proof.plant.kinds import drawn_defect, with_defects
from elastocal_proof.plant.physical_robot import specimen

USUAL = {
    "poses": 12,
    "held_out": 4,
    "ladder": (0.0, 1.0, -1.0),
    "repeats": 3,
    "repeated_poses": 4,
}


def diagnosed_campaign(top, robot, effects=(), **design):
    """Measure a robot of the plant with some defects, diagnose it, and write what an
    audit reads of it: the campaign `cell`."""
    file = ROBOTS / f"{robot}.yaml"
    arm = arm_from_file(file)
    planned = Design(**USUAL | {"points": arm.points[-1:]} | design)
    bad = with_defects(
        specimen(arm, 4, weighs=False),
        [drawn_defect(effect, arm, 4) for effect in effects],
    )
    write_blind_campaign(
        top / "cell",
        "cell",
        file,
        Experiment(bad, planned, schedule_of(arm, planned, 3)),
    )
    results = top / "results/loop/cell"
    reports = top / "reports/loop/cell"
    results.mkdir(parents=True)
    reports.mkdir(parents=True)
    descriptions, *parts = load_campaign(read_campaign_folder(top / "cell", ROBOTS))
    for name, part in zip(("training", "held_out"), parts, strict=True):
        write_table(
            results / f"{name}.parquet",
            schemas.measurements(arm.joints),
            [tabulate_measurements(part)],
            {},
        )
    write_json(results / "campaign.json", descriptions)
    case, unseen = (
        build_case(descriptions, tabulate_measurements(part)) for part in parts
    )
    found = diagnose(case, Settings(), 1)
    write_json(
        results / "diagnosis.json",
        tables.diagnosis_facts(found) | {"covariance": found.final.covariance.tolist()},
    )
    write_table(results / "steps.parquet", schemas.STEPS, tables.step_blocks(found), {})
    # As the next job does: from the files.
    again = tables.diagnosis_from(case, tables.diagnosis_facts(found))
    blocks = generate_residual_blocks(again, judged(again, unseen, 1))
    write_table(
        reports / "residuals.parquet", schemas.residuals(arm.joints), blocks, {}
    )
    return top


def audit_of(top, *files):
    """Findings of files of the campaign `cell`, all of them by default, every row
    looked at."""
    run = Audited(top, CONFIGURATION, {}, {}, 10**6)
    files = files or [
        path.relative_to(top).as_posix() for path in sorted(top.glob("re*/loop/cell/*"))
    ]
    return [
        finding
        for file in files
        for _, check, arguments in checks_of(file)
        for finding in check(run, file, **arguments)
    ]
