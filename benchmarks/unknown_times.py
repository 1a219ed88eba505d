"""How often drifts and warming robots are stated if the campaign states no times, and
what the order of the rows costs robots that have no such effect.

`python benchmarks/unknown_times.py 40 7002` diagnoses the cases of the blind run whose
times are hidden, by the seed, and so many of its other cases without their times. With
`--break`, the robot stands still for half of the campaign's time after three fifths of
its rows, so that the rows do not follow each other at an even pace.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pandas as pd
from rates import format_rate

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.io.documents import read_document
from elastocal.io.json_files import read_json
from elastocal.loop.whole import read_cases
from elastocal_proof.blind import cases as blind_cases
from elastocal_proof.blind.scores import build_case_row

CONFIG = Path(__file__).resolve().parents[1] / "config"
WITHOUT_TIMES = "without_time_and_temperature"
SETTINGS = (WITHOUT_TIMES, "without_covariates")
OF_TIME = ("frame_drift", "temperature_gradient", "thermal_growth")
OTHER_GROUPS = ("none", "single", "outside", "pair")
# Effects weaker than this are found as rarely with times.
LEAST_LEVEL = 50.0
# Share of the rows before the break, and its duration over that of all rows.
ROWS_BEFORE = 0.6
DURATION = 0.5
DRAW_SCHEDULE = blind_cases.draw_schedule


def list_cases(plan, count, seed):
    """List the cases without times: those of the blind run, and `count` of each other
    group."""
    cases = blind_cases.list_cases(plan, "registered", seed)
    chosen = [
        case
        for case in cases
        if case.setting in SETTINGS and case.effects != ("hysteresis",)
    ]
    for group in OTHER_GROUPS:
        others = [
            case
            for case in cases
            if case.group == group
            and case.setting == "usual"
            and not set(case.effects) & set(OF_TIME)
            and max(case.levels, default=LEAST_LEVEL) >= LEAST_LEVEL
        ]
        chosen += [
            replace(
                case, setting=WITHOUT_TIMES, changes=plan["settings"][WITHOUT_TIMES]
            )
            for case in others[:count]
        ]
    return chosen


def draw_schedule_with_break(arm, design, seed):
    """Draw the states of a campaign that is interrupted."""
    schedule = DRAW_SCHEDULE(arm, design, seed)
    end = schedule.time_s.max()
    is_late = schedule.time_s > ROWS_BEFORE * end
    return replace(schedule, time_s=schedule.time_s + DURATION * end * is_late)


def diagnose_cases(plan, cases, seed, folder):
    """Make and diagnose cases; return a row of scores of each."""
    robots = CONFIG / "robots"
    rows = []
    for case in cases:
        blind_cases.write_sealed_case(case, folder, folder / "sealed", robots)
        training, _ = read_cases((folder / case.name).as_posix(), robots.as_posix())
        verdict = diagnose(training, Settings(), seed).document
        truth = read_json(folder / "sealed" / f"{case.name}.json")
        rows.append(build_case_row(plan, truth, verdict))
    return pd.DataFrame(rows)


def main():
    """Print the rates by what is true."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=int, help="of each other group")
    parser.add_argument("seed", type=int)
    parser.add_argument("--break", action="store_true", dest="interrupted")
    arguments = parser.parse_args()
    plan = read_document(CONFIG / "blind.yaml")
    cases = list_cases(plan, arguments.cases, arguments.seed)
    schedule = draw_schedule_with_break if arguments.interrupted else DRAW_SCHEDULE
    with (
        tempfile.TemporaryDirectory() as folder,
        patch.object(blind_cases, "draw_schedule", schedule),
    ):
        scores = diagnose_cases(plan, cases, arguments.seed, Path(folder))
    of_time = scores.truth.isin(OF_TIME)
    for name, group in scores.groupby(scores.truth.where(of_time, scores.group)):
        print(f"{name}: detected {format_rate(group.detected)}")
        print(f"    right name alone {format_rate(group.named_right)}")
        print(f"    one wrong name alone {format_rate(group.wrong_name)}")
        print(f"    any false mechanism {format_rate(group.false_mechanism)}")


if __name__ == "__main__":
    main()
