"""Small simulated campaigns that are diagnosed, the files that an audit reads of them,
and the findings of the audit."""

from analysed_robots import ROBOTS
from made_audits import CONFIGURATION

from elastocal.campaigns.campaign import tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import generate_residual_blocks
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.cases import build_case
from elastocal.io.json_files import write_json
from elastocal.io.storage import write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop import schemas
from elastocal.loop.loading import load_campaign
from elastocal.loop.whole import judge_and_predict
from elastocal_proof.audit.audit_run import find_checks
from elastocal_proof.audit.finished_run import FinishedRun
from elastocal_proof.blind.folders import Experiment, write_blind_campaign
from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.kinds import apply_defects, draw_defect
from elastocal_proof.plant.simulated_robot import draw_specimen

DEFAULT_DESIGN = {
    "poses": 12,
    "held_out": 4,
    "ladder": (0.0, 1.0, -1.0),
    "repeats": 3,
    "repeated_poses": 4,
}


def diagnosed_campaign(top, robot, effects=(), **design):
    """Measure a simulated robot with some defects, diagnose it, and write the files that
    an audit reads, as the campaign `cell`."""
    file = ROBOTS / f"{robot}.yaml"
    arm = read_arm(file)
    planned_design = Design(**DEFAULT_DESIGN | {"points": arm.points[-1:]} | design)
    specimen = apply_defects(
        draw_specimen(arm, 4, weighs=False),
        [draw_defect(effect, arm, 4) for effect in effects],
    )
    write_blind_campaign(
        top / "cell",
        "cell",
        file,
        Experiment(specimen, planned_design, draw_schedule(arm, planned_design, 3)),
    )
    results = top / "results/loop/cell"
    reports = top / "reports/loop/cell"
    results.mkdir(parents=True)
    reports.mkdir(parents=True)
    descriptions, *measurements = load_campaign(
        read_campaign_folder(top / "cell", ROBOTS)
    )
    for name, of_set in zip(("training", "held_out"), measurements, strict=True):
        write_table(
            results / f"{name}.parquet",
            schemas.MEASUREMENTS.for_joints(arm.joints),
            [tabulate_measurements(of_set)],
            {},
        )
    write_json(results / "campaign.json", descriptions)
    case, unseen = (
        build_case(descriptions, tabulate_measurements(of_set))
        for of_set in measurements
    )
    diagnosis = diagnose(case, Settings(), 1)
    write_json(
        results / "diagnosis.json",
        tables.serialize_diagnosis(diagnosis)
        | {"covariance": diagnosis.final.covariance.tolist()},
    )
    write_table(
        results / "steps.parquet",
        schemas.STEPS,
        tables.generate_step_blocks(diagnosis),
        {},
    )
    # The next job restores the diagnosis from the files, too.
    restored = tables.restore_diagnosis(case, tables.serialize_diagnosis(diagnosis))
    blocks = generate_residual_blocks(restored, judge_and_predict(restored, unseen, 1))
    write_table(
        reports / "residuals.parquet",
        schemas.RESIDUALS.for_joints(arm.joints),
        blocks,
        {},
    )
    return top


def audit_of(top, *files):
    """Return the findings about files of the campaign `cell`, by default about all of
    them; every row is checked."""
    run = FinishedRun(top, CONFIGURATION, {}, {}, 10**6)
    files = files or [
        path.relative_to(top).as_posix() for path in sorted(top.glob("re*/loop/cell/*"))
    ]
    return [
        finding
        for file in files
        for _, check, arguments in find_checks(file)
        for finding in check(run, file, **arguments)
    ]
