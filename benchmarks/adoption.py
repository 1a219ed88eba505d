"""How well do effects predict that are adopted from few poses?

`python benchmarks/adoption.py CASES SEED` simulates campaigns of 15 to 40 poses without
loads, with geometric errors, one or two effects of the catalogue or outside of it, and
errors common to a pose. Each campaign is diagnosed twice: effects always enter the
model, or never. It prints held-out RMS errors of both and whether the rule adopts, and
for the rule and for adopting always the mean log ratio to never adopting, with a 95 %
interval by Student's t.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
from common import ROBOTS
from gross_error_rates import NOISE_M, REFLECTORS, Robot, measure
from scipy.stats import t as student_t

from elastocal.campaigns.writing import write_campaign
from elastocal.diagnosis import adoption
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.settings import Settings
from elastocal.loop.whole import read_cases
from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.kinds import KINDS, Defect, apply_defects
from elastocal_proof.plant.simulated_robot import draw_specimen

ARMS = ("panda", "irb7600", "gen3", "m900ib700", "kuka", "abb")
FEWEST_POSES = 15
MOST_POSES = 40
HELD_OUT = 40
# Standard deviations of the geometry, rad and m, and errors common to a pose, rad.
GEOMETRY = 3e-4
POSE_ERRORS_RAD = (0.0, 5e-6, 1.5e-5, 5e-5)
# Range of the size of an effect, in plausible sizes.
SMALLEST_TIMES = 0.3
LARGEST_TIMES = 4.5
# Effects that need a load, or whose true size no pose shows.
EXCLUDED = ("force", "application_point", "setup_step", "nest", "joint_offset")


def draw_campaign(seed):
    """Draw a robot with its effects and the states of its campaign; return them and the
    names of the effects."""
    draws = np.random.default_rng([seed, 11])
    name = ARMS[seed % len(ARMS)]
    arm = read_arm(ROBOTS / f"{name}.yaml")
    ratio = MOST_POSES / FEWEST_POSES
    poses = round(FEWEST_POSES * ratio ** draws.random())
    design = Design(
        poses=poses + HELD_OUT,
        held_out=HELD_OUT,
        ladder=(0.0,),
        repeats=1,
        repeated_poses=0,
    )
    defects = [
        Defect(effect, (joint,), draws.normal(0.0, GEOMETRY), seed + joint)
        for effect in ("joint_offset", "link_geometry")
        for joint in range(1, arm.joints + 1)
    ]
    effects = draw_effects(arm, draws, seed)
    defects += effects
    specimen = draw_specimen(arm, seed, weighs=draws.random() < 0.2)
    pose_rad = (float(draws.choice(POSE_ERRORS_RAD)),) * arm.joints
    simulated = apply_defects(replace(specimen, pose_rad=pose_rad), defects)
    names = [effect.effect for effect in effects]
    return Robot(name, simulated, draw_schedule(arm, design, seed)), names


def draw_effects(arm, draws, seed):
    """Draw one or two effects; one that the arm has nowhere is left out."""
    names = [effect for effect in KINDS if not effect.startswith(EXCLUDED)]
    defects = []
    for effect in draws.choice(names, draws.integers(1, 3), replace=False).tolist():
        kind = KINDS[effect]
        locations = kind.locations(arm)
        if not locations:
            continue
        times = SMALLEST_TIMES * (LARGEST_TIMES / SMALLEST_TIMES) ** draws.random()
        size = min(times * kind.scale_plausible_size(arm), kind.largest)
        location = locations[draws.integers(len(locations))]
        defects.append(Defect(effect, location, size, seed))
    return defects


def write_cases(robot, seed, folder):
    """Measure a campaign; return its training case and its held-out case."""
    table = measure(robot, seed)
    arm = robot.simulated.arm
    poses = np.unique(table["pose"]).tolist()
    document = {
        "campaign": "adoption",
        "robot": robot.name,
        "measured": "position",
        "frame": "tracker",
        "targets": {
            name: {"point": arm.points[-1], "offset_m": list(offset)}
            for name, offset in REFLECTORS.items()
        },
        "compliance": "nominal",
        "declared": ["joint_offset", "link_geometry"],
        "noise": {"position_m": NOISE_M},
        "holdout": {"poses": poses[-HELD_OUT:]},
        "remainder": "none",
    }
    write_campaign(folder, document, table, arm.joints, "csv")
    return read_cases(folder, ROBOTS)


def compare_adoption(training, held_out):
    """Held-out RMS errors, m, of never and of always adopting, and what the rule says;
    None if there is nothing to adopt."""
    rule = adoption.describe_missing_gain
    refusals = []

    def adopt(*arguments):
        refusals.append(rule(*arguments))
        return []

    rms_m = []
    for decide in (lambda *_: ["never"], adopt):
        with patch.object(adoption, "describe_missing_gain", decide):
            diagnosis = diagnose(training, Settings(), 1)
        rms_m.append(judge(diagnosis, held_out, 1).verdict.heldout.after.rms_m)
        if not refusals and decide is adopt:
            return None
    return *rms_m, not refusals[-1]


def print_ratio(name, log_ratios):
    """Print the ratio of errors to those of never adopting, with its interval."""
    count = len(log_ratios)
    mean = np.mean(log_ratios)
    half = student_t.ppf(0.975, count - 1) * np.std(log_ratios, ddof=1) / np.sqrt(count)
    low, high = np.exp([mean - half, mean + half])
    worse = int((np.array(log_ratios) > np.log(1.02)).sum())
    print(
        f"{name}: {np.exp(mean):.3f} ({low:.3f}-{high:.3f}) times the error of never"
        f" adopting, n = {count}; worse by over 2 %: {worse}"
    )


def main():
    """Print a line for each campaign in which something may be adopted, and ratios."""
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", type=int)
    parser.add_argument("seed", type=int)
    asked = parser.parse_args()
    always = []
    by_rule = []
    for seed in range(asked.seed, asked.seed + asked.cases):
        robot, effects = draw_campaign(seed)
        with TemporaryDirectory() as folder:
            compared = compare_adoption(*write_cases(robot, seed, Path(folder) / "c"))
        if compared is None:
            continue
        never_m, always_m, adopts = compared
        always.append(np.log(always_m / never_m))
        by_rule.append(always[-1] if adopts else 0.0)
        print(
            f"{seed} {robot.name} {effects}: never {1e3 * never_m:.4f} mm, always"
            f" {1e3 * always_m:.4f} mm, the rule {'adopts' if adopts else 'refuses'}",
            flush=True,
        )
    print_ratio("always adopting", always)
    print_ratio("by the rule", by_rule)


if __name__ == "__main__":
    main()
