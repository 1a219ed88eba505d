"""How often a diagnosis raises a false alarm, and how often it names an effect, if a
robot is measured without a tracker.

A simulated UR10 with errors of its geometry, which the campaign declares, is measured by
each kind: a ball in three sockets, a tip on three planes, a draw wire from three anchors,
and a camera on the flange before a board, whose noise is estimated or declared, and whose
frame has its origin in the middle or, as OpenCV has it, at a corner. Every
second robot also has a clear effect at a joint that is drawn. The oracle knows effect,
joint and noise, and tests the effect on the same data. `python benchmarks/instruments.py
CASES SEED [KIND ...]` prints a row a kind with 95 % intervals (Clopper and Pearson, 1934),
some three seconds a case.
"""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import ROBOTS
from rates import format_rate, make_parser
from scipy.spatial.transform import Rotation

from elastocal.campaigns.reading import read_robot
from elastocal.campaigns.writing import write_campaign
from elastocal.loop.whole import diagnose_folder
from elastocal.mechanics.kinematics import compute_point_poses
from elastocal_proof.blind.oracle import fit_oracle
from elastocal_proof.plant.arm import read_arm
from elastocal_proof.plant.contacts import (
    Workshop,
    find_view,
    read_length,
    seat_in_socket,
    see_board,
    touch_plane,
)
from elastocal_proof.plant.kinds import KINDS, Defect, apply_defects
from elastocal_proof.plant.simulated_robot import (
    Schedule,
    draw_specimen,
    simulate_poses,
)

ROBOT = "ur10"
# Effects that act on a robot without a load, and their sizes in plausible sizes: some ten
# times the noise at the tool.
TIMES = {
    "transmission_harmonic": 10.0,
    "transmission_ratio": 5.0,
    "bearing_runout": 10.0,
    "link_weight": 3.0,
}
# An effect is at one of the first joints, because those behind hardly move the tool.
LAST_JOINT = 4
# Standard deviations of the declared errors of each joint and link.
OFFSET_RAD = 1e-3
GEOMETRY_M = 3e-4
TOOL_M = np.array([0.02, 0.03, 0.15])
# Middle of the workspace, elbow up and tool down, and how far joints turn from it, rad.
MIDDLE_RAD = np.array([0.3, -1.2, 1.4, -1.7, -1.6, 0.0])
HALF_RANGE_RAD = 1.6
ROWS = 120
BOARD_ROWS = 60
PLACES_RAD = np.array([[0.0] * 6, [0.5, 0.1, 0.1, 0, 0, 0], [-0.4, 0.2, -0.3, 0, 0, 0]])
NORMALS = np.array([[0.0, 0.0, 1.0], [0.8, 0.6, 0.0], [0.0, 0.8, 0.6]])
ANCHORS_M = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.5], [0.5, -1.2, 0.2]])
BOARD_M = 0.25
# Place of the middle of the board in a frame at one of its corners.
MIDDLE_M = np.array([0.1, 0.15, 0.0])
# Play of a printed socket, form of a granite table, and noise of a draw wire, m.
NOISE_M = {"point": 1e-4, "plane": 3e-5, "distance": 1e-4}
# Error of the corners of a board, an angle of view, rad, and what it makes of the board in
# the camera at 0.6 m: the noise that a user may declare.
VIEW_RAD = 1e-4
DECLARED_NOISE = {"position_m": 1e-4, "orientation_rad": 5e-4}


@dataclass(frozen=True)
class Measured:
    """Rows that were measured, and the keys of campaign.yaml that belong to them."""

    angles: np.ndarray
    columns: dict
    document: dict


def open_workshop(seed, defects):
    """Place a robot with errors of its geometry and with defects in a workshop."""
    arm = read_arm(ROBOTS / f"{ROBOT}.yaml")
    draws = np.random.default_rng([seed, 1])
    declared = []
    for joint in range(1, arm.joints + 1):
        offset = Defect("joint_offset", (joint,), draws.normal(0.0, OFFSET_RAD), seed)
        length = Defect("link_geometry", (joint,), draws.normal(0.0, GEOMETRY_M), seed)
        declared += [offset, length]
    robot = apply_defects(draw_specimen(arm, seed, weighs=False), [*declared, *defects])
    limits = np.column_stack([MIDDLE_RAD - HALF_RANGE_RAD, MIDDLE_RAD + HALF_RANGE_RAD])
    chain = read_robot(ROBOTS / f"{ROBOT}.yaml").chain
    tool = replace(chain.end_effector, offset_m=tuple(TOOL_M.tolist()))
    return Workshop(
        partial(locate_tool, robot),
        limits,
        np.random.default_rng([seed, 2]),
        lambda angles: [
            array[0] for array in compute_point_poses(chain, angles, [tool])
        ],
    )


def locate_tool(robot, angles):
    """Locate the tool of a robot at rest without a load, in base axes."""
    count = len(angles)
    nothing = np.zeros((count, 3))
    numbers = np.arange(count)
    schedule = Schedule(
        angles,
        force=nothing,
        lever=nothing,
        pose=numbers,
        load=0 * numbers,
        repeat=0 * numbers,
        approach=numbers,
        sense=np.ones_like(angles, int),
        previous=0 * numbers - 1,
        time_s=60.0 * numbers,
        training=numbers >= 0,
        seed=0,
    )
    position, rotation = (array[:, -1] for array in simulate_poses(robot, schedule))
    return position + rotation @ TOOL_M, rotation


def measure_point(workshop):
    """Hold a ball in three sockets."""
    places = workshop.locate(MIDDLE_RAD + PLACES_RAD)[0]
    return _measure_features(
        "point",
        lambda number: (
            seat_in_socket(workshop, places[number], NOISE_M["point"]),
            None,
        ),
    )


def measure_plane(workshop):
    """Touch three planes through one place."""
    place = workshop.find_tool(MIDDLE_RAD)[0]

    def touch(number):
        normal = NORMALS[number]
        return touch_plane(workshop, normal, normal @ place, NOISE_M["plane"]), None

    return _measure_features("plane", touch)


def measure_distance(workshop):
    """Read a draw wire from three anchors."""

    def read(number):
        angles = workshop.draw_angles()
        return angles, read_length(
            workshop, angles, ANCHORS_M[number], NOISE_M["distance"]
        )

    return _measure_features("distance", read)


def _measure_features(kind, measure):
    """Measure three features in turn; `measure` returns joint angles and the value."""
    numbers = np.arange(ROWS) % 3
    rows = [measure(number) for number in numbers]
    columns = {"feature": [f"{kind}{number}" for number in numbers]}
    if rows[0][1] is not None:
        columns["value"] = [value for _, value in rows]
    document = {
        "frame": "base",
        "targets": {"tip": {"point": "6DoF", "offset_m": "unknown"}},
        "features": {f"{kind}{number}": {} for number in range(3)},
        "noise": {"position_m": NOISE_M[kind]},
    }
    return Measured(np.array([angles for angles, _ in rows]), columns, document)


def measure_board(workshop, noise=None, middle_m=(0.0, 0.0, 0.0)):
    """See a board half a metre before the tool in the middle of the workspace. Its noise
    is estimated unless it is declared; its middle is at `middle_m` in its frame."""
    position, rotation = workshop.find_tool(MIDDLE_RAD)
    board = position + 0.5 * rotation[:, 2], rotation
    angles = np.array([find_view(workshop, board) for _ in range(BOARD_ROWS)])
    poses = [see_board(workshop, row, board, VIEW_RAD, BOARD_M) for row in angles]
    numbers = np.array([np.concatenate(pose) for pose in poses])
    numbers[:, :3] -= Rotation.from_rotvec(numbers[:, 3:]).apply(middle_m)
    columns = dict(zip(("x", "y", "z", "rx", "ry", "rz"), numbers.T, strict=True))
    document = {
        "camera": "on_robot",
        "frame": "unknown",
        "targets": {
            "tip": {"point": "6DoF", "offset_m": "unknown", "rotation": "unknown"}
        },
    }
    if noise:
        document["noise"] = noise
    return Measured(angles, columns, document)


INSTRUMENTS = {
    "point": measure_point,
    "board": measure_board,
    "board_declared": partial(measure_board, noise=DECLARED_NOISE),
    "board_corner": partial(measure_board, middle_m=MIDDLE_M),
    "plane": measure_plane,
    "distance": measure_distance,
}


def write_case(folder, kind, workshop):
    """Measure a robot by a kind and write the campaign."""
    measured = INSTRUMENTS[kind](workshop)
    count = len(measured.angles)
    table = {
        "pose": np.arange(count),
        "load": np.zeros(count, int),
        "repeat": np.zeros(count, int),
        "target": ["tip"] * count,
    }
    table |= {f"q{joint}": row for joint, row in enumerate(measured.angles.T, 1)}
    document = {
        "campaign": "instruments",
        "robot": ROBOT,
        "measured": kind.partition("_")[0],
        "compliance": "nominal",
        "declared": ["joint_offset", "link_geometry"],
        "holdout": {"fraction": 0.25, "seed": 1},
        **measured.document,
    }
    joints = measured.angles.shape[1]
    write_campaign(folder, document, table | measured.columns, joints, "csv")


def diagnose_case(kind, seed, effect):
    """Diagnose one robot; return verdict.json, the defects and the oracle's outcome."""
    arm = read_arm(ROBOTS / f"{ROBOT}.yaml")
    defects = []
    if effect:
        locations = [
            joints
            for joints in KINDS[effect].locations(arm)
            if max(joints) <= LAST_JOINT
        ]
        joints = locations[np.random.default_rng([seed, 3]).integers(len(locations))]
        size = TIMES[effect] * KINDS[effect].scale_plausible_size(arm)
        defects = [Defect(effect, joints, size, seed)]
    with TemporaryDirectory() as parent:
        folder = Path(parent) / "instruments"
        write_case(folder, kind, open_workshop(seed, defects))
        verdict = diagnose_folder(folder, ROBOTS, seed)
        truth = {"defects": [vars(defect) for defect in defects]}
        oracle = fit_oracle(truth, verdict, folder, ROBOTS, seed) if defects else None
    return verdict, defects, oracle


@dataclass(frozen=True)
class Outcome:
    """What a diagnosis says of one robot.

    `near` is the held-out RMS error over that of the oracle.
    """

    effect: str | None
    names: set
    alarm: bool
    detected: bool = False
    near: float = np.nan

    @property
    def named(self):
        """Whether the effect is named, and nothing else."""
        return self.names == {self.effect}

    @property
    def misnamed(self):
        """Whether one other effect is named alone."""
        return len(self.names) == 1 and not self.named


def study_case(kind, number, seed, *, each):
    """Diagnose one robot of a kind; every second one has an effect."""
    effect = list(TIMES)[number // 2 % len(TIMES)] if number % 2 else None
    verdict, defects, oracle = diagnose_case(kind, seed, effect)
    names = {found["name"] for found in verdict["effects"]}
    if each:
        joints = [defect.joints for defect in defects]
        p_value = oracle and oracle["p_value"]
        print(
            kind, seed, effect, joints, p_value, verdict["verdict"], names, flush=True
        )
    alarm = verdict["verdict"] not in ("adequate", "not_testable")
    if effect is None:
        return Outcome(effect, names, alarm)
    near = verdict["heldout"]["after"]["rms_m"] / oracle["heldout"]["rms_m"]
    return Outcome(effect, names, alarm, oracle["detected"], near)


def format_row(kind, outcomes):
    """Format the rates of a kind as a row."""
    nulls = [outcome for outcome in outcomes if outcome.effect is None]
    effects = [outcome for outcome in outcomes if outcome.effect]
    detected = [outcome for outcome in effects if outcome.detected]
    near = np.median([outcome.near for outcome in detected]) if detected else np.nan
    cells = [
        kind,
        format_rate(outcome.alarm for outcome in nulls),
        format_rate(outcome.detected for outcome in effects),
        format_rate(outcome.alarm for outcome in detected),
        format_rate(outcome.named for outcome in detected),
        format_rate(outcome.misnamed for outcome in effects),
        f"{near:.2f}",
    ]
    return f"| {' | '.join(cells)} |"


def main():
    """Print the rows of the kinds."""
    arguments = make_parser(__doc__, tuple(INSTRUMENTS)).parse_args()
    heads = [
        "kind",
        "false alarms",
        "the oracle detects",
        "alarm, of those",
        "named alone, of those",
        "another name alone",
        "held-out RMS over the oracle's",
    ]
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|", flush=True)
    everything = []
    for kind in arguments.robots:
        outcomes = [
            study_case(kind, number, arguments.first_seed + number, each=arguments.each)
            for number in range(arguments.cases)
        ]
        everything += outcomes
        print(format_row(kind, outcomes), flush=True)
    print(format_row("all", everything))
    for effect in TIMES:
        named = [
            outcome.named
            for outcome in everything
            if outcome.detected and outcome.effect == effect
        ]
        print(f"{effect}: named alone, of those detected: {format_rate(named)}")


if __name__ == "__main__":
    main()
