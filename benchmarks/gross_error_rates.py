"""How often good rows are left out as gross errors, and wrong rows are not.

Simulated campaigns of arms with six and seven axes: three reflectors on the flange,
every pose without a load, and in one of three campaigns also with one. `python
benchmarks/gross_error_rates.py effects CASES SEED [--poses 260]` plants an effect that
acts only somewhere: lost motion, stiffening, hysteresis, the end of a compensator's
range, stretched poses; no row is wrong. `slips CASES SEED` makes 1 to 5 % of the rows
wrong instead: lost beams, held points, mistyped angles, swapped rows, slipped units. It
prints a line for each case, and the rates with 95 % intervals (Clopper and Pearson,
1934).
"""

import argparse
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import ROBOTS
from rates import format_count_rate

from elastocal.campaigns.writing import write_campaign
from elastocal.loop.whole import diagnose_folder
from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.campaigns import Design, draw_schedule
from elastocal_proof.plant.kinds import KINDS, Defect, apply_defects
from elastocal_proof.plant.laws import add_drive_law
from elastocal_proof.plant.simulated_robot import draw_specimen, simulate_poses

ARMS = ("kuka", "iiwa14", "abb", "gen3")
# Reflectors on the flange, m.
REFLECTORS = {"A": (0.1, 0.0, 0.05), "B": (-0.05, 0.09, 0.05), "C": (-0.05, -0.09, 0.1)}
NOISE_M = 3e-5
OFFSET_RAD = 3e-4
POSE_RAD = 5e-6
DESIGN = Design(poses=48, held_out=14, repeats=2, repeated_poses=4)
# Shares of the typical force: under weight alone, and with a load.
LADDERS = ((0.0,), (0.0,), (0.0, 1.0))
# Effects that act somewhere, of which the last two have laws of this file.
CATALOGUE_EFFECTS = ("lost_motion", "stiffening", "hysteresis")
LOCAL_EFFECTS = (*CATALOGUE_EFFECTS, "compensator_end", "stretched_poses")
# Effects that act everywhere, beside which rows are wrong; None: no effect.
ORDINARY_EFFECTS = (None, "joint_tilt", "base_compliance", "transmission_ratio")
SLIPS = ("lost_beam", "held_point", "mistyped_angle", "swapped_rows", "unit")
# Range of the share of wrong rows of a campaign.
WRONG_SHARES = (0.01, 0.05)
# Range of the size of an effect, in plausible sizes.
SMALLEST_TIMES = 1.0
LARGEST_TIMES = 10.0
LARGEST_ORDINARY_TIMES = 3.0
# Range of the quantile of the poses beyond which an effect of the edge acts.
EDGES = (0.8, 0.95)
# Displacement at the farthest pose of the edge, m, at its plausible size.
EDGE_M = 2e-4


@dataclass(frozen=True)
class Robot:
    """A simulated robot of a case, and how it is brought into its states."""

    name: str
    simulated: object
    schedule: object
    design: Design


def draw_robot(seed, poses):
    """Draw an arm, its specimen with zero offsets, and the states of a campaign of so
    many poses."""
    name = ARMS[seed % len(ARMS)]
    arm = read_arm(ROBOTS / f"{name}.yaml")
    draws = np.random.default_rng([seed, 1])
    offsets = [
        Defect("joint_offset", (joint,), draws.normal(0.0, OFFSET_RAD), seed)
        for joint in range(1, arm.joints + 1)
    ]
    specimen = replace(
        draw_specimen(arm, seed), repeatability_rad=(POSE_RAD,) * arm.joints
    )
    design = replace(DESIGN, poses=poses, ladder=LADDERS[draws.integers(len(LADDERS))])
    schedule = draw_schedule(arm, design, seed)
    return Robot(name, apply_defects(specimen, offsets), schedule, design)


def plant_effect(robot, effect, seed):
    """Plant an effect at a joint that is drawn, of a size that is drawn."""
    if effect is None:
        return robot
    draws = np.random.default_rng([seed, 2])
    largest = LARGEST_TIMES if effect in LOCAL_EFFECTS else LARGEST_ORDINARY_TIMES
    times = SMALLEST_TIMES * (largest / SMALLEST_TIMES) ** draws.random()
    simulated = robot.simulated
    arm = simulated.arm
    if effect in KINDS:
        kind = KINDS[effect]
        locations = kind.locations(arm)
        # Joints that carry much show what a gear does.
        location = locations[draws.integers(min(len(locations), 4))]
        size = times * kind.scale_plausible_size(arm)
        size = min(size, kind.largest or size)
        return replace(
            robot,
            simulated=apply_defects(simulated, [Defect(effect, location, size, seed)]),
        )
    return replace(robot, simulated=add_edge_effect(robot, effect, times, draws))


def add_edge_effect(robot, effect, times, draws):
    """Add an error of a joint that grows from an edge of an angle, or of the reach, on."""
    simulated = robot.simulated
    joint = int(draws.integers(1, 3))
    law = partial(follow_reach, simulated)
    if effect == "compensator_end":
        law = partial(follow_angle, joint, draws.choice([-1.0, 1.0]))
    state = law(robot.schedule.angle)
    edge = np.quantile(state, draws.uniform(*EDGES))
    rad = times * EDGE_M / simulated.arm.reach_m / (state.max() - edge)
    return add_drive_law(
        simulated, joint, lambda angles: rad * np.maximum(law(angles) - edge, 0.0)
    )


def follow_angle(joint, scale, angles):
    """Angle of a joint, or its negative."""
    return scale * angles[:, joint]


def follow_reach(simulated, angles):
    """How far an arm stretches, from the angle of its elbow: the third joint of six, the
    fourth of seven."""
    elbow = 2 if simulated.arm.joints == 6 else 3
    return np.cos(angles[:, elbow])


def measure(robot, seed):
    """Measure the reflectors; a table of rows, state by state."""
    schedule = robot.schedule
    draws = np.random.default_rng([seed, 3])
    position, rotation = simulate_poses(robot.simulated, schedule)
    offsets = np.array(list(REFLECTORS.values()))
    reflectors = position[:, -1:] + np.einsum("sij,tj->sti", rotation[:, -1], offsets)
    reflectors = reflectors + NOISE_M * draws.standard_normal(reflectors.shape)
    count = len(offsets)
    moment = np.cross(schedule.lever, schedule.force)
    names = [f"q{joint}" for joint in range(1, schedule.angle.shape[1] + 1)]
    approaches = [name.replace("q", "approach") for name in names]
    columns = {"pose": schedule.pose, "load": schedule.load, "repeat": schedule.repeat}
    columns |= dict(zip(names, schedule.angle.T, strict=True))
    columns |= dict(zip(approaches, schedule.sense.T.astype(float), strict=True))
    loads = np.hstack([schedule.force, moment]).T
    columns |= dict(zip(("fx", "fy", "fz", "mx", "my", "mz"), loads, strict=True))
    table = {name: np.repeat(values, count) for name, values in columns.items()}
    table["target"] = np.tile(list(REFLECTORS), len(schedule.pose))
    table |= dict(zip("xyz", reflectors.reshape(-1, 3).T, strict=True))
    return {name: np.array(values) for name, values in table.items()}


def slip(table, seed, shares):
    """Make a share of the rows wrong, from the lower to the higher one of two; rows that
    are wrong, (N,) of bool."""
    draws = np.random.default_rng([seed, 4])
    count = len(table["pose"])
    wrong = np.zeros(count, bool)
    wanted = draws.uniform(*shares) * count
    damaged = {name: values.copy() for name, values in table.items()}
    position = np.column_stack([table[axis] for axis in "xyz"])
    original = position.copy()
    while wrong.sum() < wanted:
        kind = SLIPS[draws.integers(len(SLIPS))]
        row = int(draws.integers(1, count))
        rows = [row]
        if kind == "swapped_rows":
            rows = [row, int(draws.integers(count))]
        elif kind == "mistyped_angle":
            rows = np.flatnonzero(table["pose"] == table["pose"][row]).tolist()
        if wrong[rows].any() or len(set(rows)) < len(rows):
            continue
        wrong[rows] = True
        if kind == "lost_beam":
            position[row] = 0.0
        elif kind == "held_point":
            position[row] = original[row - 1]
        elif kind == "swapped_rows":
            position[rows] = original[rows[::-1]]
        elif kind == "unit":
            position[row] = original[row] * draws.choice([1e-3, 1e3])
        else:
            # A digit is wrong: 0.1 to 9 degrees.
            degrees = draws.integers(1, 10) * draws.choice([0.1, 1.0])
            joint = int(draws.integers(1, len([n for n in table if n[0] == "q"])))
            damaged[f"q{joint}"][rows] += np.radians(degrees)
    damaged |= dict(zip("xyz", position.T, strict=True))
    return damaged, wrong


def diagnose(robot, table):
    """Verdict on a table."""
    joints = robot.simulated.arm.joints
    first = robot.design.poses - robot.design.held_out
    document = {
        "campaign": "rates",
        "robot": robot.name,
        "measured": "position",
        "frame": "base",
        "targets": {
            name: {"point": robot.simulated.arm.points[-1], "offset_m": list(offset)}
            for name, offset in REFLECTORS.items()
        },
        "compliance": "identify",
        "declared": ["joint_offset", "link_weight"],
        "noise": {"position_m": NOISE_M},
        "holdout": {
            "poses": [
                pose for pose in np.unique(table["pose"]).tolist() if pose >= first
            ]
        },
    }
    with TemporaryDirectory() as folder:
        write_campaign(Path(folder) / "rates", document, table, joints, "csv")
        return diagnose_folder(Path(folder) / "rates", ROBOTS, 1)


def list_left_out(verdict, count):
    """Rows that a verdict leaves out, (N,) of bool."""
    left_out = np.zeros(count, bool)
    for gross_error in verdict["gross_errors"]:
        left_out[np.array(gross_error["rows"]) - 1] = True
    return left_out


def summarize(verdict):
    """The verdict, and names and joints of its effects."""
    effects = [(e["name"], tuple(e["joints"])) for e in verdict["effects"]]
    return verdict["verdict"], sorted(effects)


def study_effects(cases, seed, poses):
    """Left-out rows of campaigns in which no row is wrong."""
    left_out = []
    rows = []
    for case in range(seed, seed + cases):
        effect = LOCAL_EFFECTS[case // len(ARMS) % len(LOCAL_EFFECTS)]
        robot = plant_effect(draw_robot(case, poses), effect, case)
        table = measure(robot, case)
        start = time.process_time()
        verdict = diagnose(robot, table)
        rows.append(len(table["pose"]))
        left_out.append(int(list_left_out(verdict, rows[-1]).sum()))
        rms = verdict["heldout"]["after"]["rms_m"] if verdict["heldout"] else np.nan
        print(
            f"{case} {robot.name} {effect}: {left_out[-1]} of {rows[-1]} left out,"
            f" {summarize(verdict)}, held-out {1e3 * rms:.4f} mm,"
            f" {time.process_time() - start:.1f} s",
            flush=True,
        )
    print("good rows left out:", format_count_rate(sum(left_out), sum(rows)))
    print(
        "campaigns that lose a row:",
        format_count_rate(np.count_nonzero(left_out), cases),
    )


def study_slips(cases, seed, poses, shares):
    """Wrong rows that are left out, and verdicts that stay as without them."""
    counts = np.zeros(5, int)
    for case in range(seed, seed + cases):
        effect = ORDINARY_EFFECTS[case // len(ARMS) % len(ORDINARY_EFFECTS)]
        robot = plant_effect(draw_robot(case, poses), effect, case)
        table = measure(robot, case)
        damaged, wrong = slip(table, case, shares)
        start = time.process_time()
        verdict = diagnose(robot, damaged)
        seconds = time.process_time() - start
        rest = {name: values[~wrong] for name, values in table.items()}
        undamaged = diagnose(robot, rest)
        left_out = list_left_out(verdict, len(wrong))
        same = summarize(verdict) == summarize(undamaged)
        hits = (wrong & left_out).sum()
        false = (~wrong & left_out).sum()
        counts += [hits, wrong.sum(), false, (~wrong).sum(), same]
        print(
            f"{case} {robot.name} {effect}: {hits} of {wrong.sum()} wrong rows out,"
            f" {false} good ones, {summarize(verdict)}, without {summarize(undamaged)},"
            f" {seconds:.1f} s",
            flush=True,
        )
    print("wrong rows left out:", format_count_rate(counts[0], counts[1]))
    print("good rows left out:", format_count_rate(counts[2], counts[3]))
    print("same verdict as without them:", format_count_rate(counts[4], cases))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("study", choices=("effects", "slips"))
    parser.add_argument("cases", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument(
        "--poses",
        type=int,
        default=DESIGN.poses,
        help="poses of a campaign; of more than some 130 a sample is weighed",
    )
    parser.add_argument(
        "--wrong",
        type=float,
        nargs=2,
        default=WRONG_SHARES,
        help="lowest and highest share of wrong rows",
    )
    asked = parser.parse_args()
    if asked.study == "effects":
        study_effects(asked.cases, asked.seed, asked.poses)
    else:
        study_slips(asked.cases, asked.seed, asked.poses, asked.wrong)
