"""Cases of the blind benchmark: their list, and the making of one case, which is a
campaign for the analyst and a sealed ground truth.

The name of a case is a hash, so that neither its folder nor its position in a list
reveals its contents. Its seed follows from its key: adding cases, or making them in
another order or in blocks, changes no existing case. A plan, the contents of
config/blind.yaml, says which cases there are.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import combinations, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from elastocal_proof.blind.folders import Experiment, write_blind_campaign, write_truth
from elastocal_proof.plant.arm import Arm, LinkMass, read_arm
from elastocal_proof.plant.campaigns import (
    BLUNDER_KINDS,
    Blunder,
    Design,
    Table,
    add_blunders,
    draw_schedule,
)
from elastocal_proof.plant.kinds import (
    KINDS,
    OUTSIDE,
    Defect,
    apply_defects,
    draw_defect,
)
from elastocal_proof.plant.laws import draw_direction
from elastocal_proof.plant.multibody import compute_typical_gravity_torque
from elastocal_proof.plant.simulated_robot import (
    Motion,
    SimulatedRobot,
    Tracker,
    draw_specimen,
    open_simulation_stream,
)
from elastocal_proof.plant.sizing import NoncentralityModel

Plan = Mapping[str, Any]

PROOF = "proof"
TUNED = "tuned"
CATALOGUE_EFFECTS = tuple(
    sorted(kind for kind in KINDS if not kind.startswith(OUTSIDE))
)
OUTSIDE_EFFECTS = tuple(sorted(kind for kind in KINDS if kind.startswith(OUTSIDE)))
# This effect hides the weight of the links from the analyst: the robot file declares
# none, and the arm has no other weight.
HIDDEN_WEIGHT = "link_weight"
SEVERAL_JOINTS = "several_joints"
GEAR_GRAVITY = "gear_gravity"
MOVED = "moved"
UNDECLARED = "undeclared"
REMAINS = "remains"
# Errors that are smooth functions of the angles of two joints. Their non-centrality is
# so far beyond the noise that a repeatable residual remains under any verdict.
_TWO_ANGLE_EFFECTS = (OUTSIDE + "cable_pull", OUTSIDE + "two_angles")
_REMAINING = 1e4
# Mechanisms that occur at several joints at once, as after a bad mastering or with gears
# of one type.
MULTI_JOINT_EFFECTS = (
    "bearing_runout",
    "hysteresis",
    "joint_dependent_stiffness",
    "joint_offset",
    "joint_tilt",
    "link_elasticity",
    "link_geometry",
    "lost_motion",
    "motor_eccentricity",
    "stiffening",
    "transmission_harmonic",
    "transmission_order",
    "transmission_ratio",
)
_MIN_JOINTS = 3
# Gear effects that depend on the weight. They are placed at joints whose gravity torque
# is more than this share of the largest one.
GEAR_EFFECTS = ("hysteresis", "joint_dependent_stiffness", "lost_motion", "stiffening")
_GRAVITY_SHARE = 0.2
# Non-centralities of single effects, of effects outside of the catalogue, of pairs, of
# effects in a special setting, and of groups whose effects should be easy to detect.
_LEVELS = (25.0, 50.0, 200.0)
_OUTSIDE_LEVELS = (200.0,)
_PAIR_LEVELS = (50.0, 200.0)
_SETTING_LEVEL = 50.0
_HIGH = 200.0
# A stand that is knocked moves by a millimetre, which is far more than the smallest
# visible shift, and no arm weighs only a few kilograms.
_KNOCKED = 1e5
_HEAVY = 1e6
# Locations that are drawn for an effect until one needs no implausible size.
_DRAWS = 8
# Steps of the secant method that finds a size.
_SECANT_STEPS = 12
# Standard deviations of a misplaced base along one axis: 0.3 mrad and 0.2 mm as the
# root mean square of all three.
_TILT_RAD = 3e-4 / np.sqrt(3.0)
_SHIFT_M = 2e-4 / np.sqrt(3.0)
# A size beyond this multiple of the plausible one is implausible.
_MAX_PLAUSIBLE_RATIO = 3.0


@dataclass(frozen=True)
class BlindCase:
    """One case, which determines its campaign and its ground truth.

    Attributes
    ----------
    key : str
        Contents of the case in words; sealed.
    group : str
        Group of cases that the scores report together.
    robot : str
        Robot file in config/robots, without its suffix.
    effects : tuple of str
        Keys of `KINDS`.
    levels : tuple of float
        Non-centrality of each effect alone, after absorption; for one mechanism at
        several joints the non-centrality of all of them together.
    setting : str
        Name of the setting.
    seed : int
        Seed of everything that is drawn.
    robots : str
        `PROOF` or `TUNED`.
    changes : dict
        What the setting changes in the usual campaign, as in the plan.
    """

    key: str
    group: str
    robot: str
    effects: tuple[str, ...]
    levels: tuple[float, ...]
    setting: str
    seed: int
    robots: str = PROOF
    changes: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the folder, which reveals nothing."""
        digest = hashlib.sha256(f"{self.seed}/{self.key}".encode()).hexdigest()
        return f"case_{digest[:12]}"

    @property
    def design(self) -> Design:
        """Design of the campaign."""
        changes: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value
            for key, value in self.changes.get("design", {}).items()
        }
        ratio = self.changes.get("declared_ratio")
        if ratio:
            tracker = self.tracker
            changes["repeats"] = 1
            changes["declared_noise"] = (
                ratio * tracker.sigma_m,
                ratio * tracker.sigma_rad,
            )
        return replace(Design(), **changes)

    @property
    def tracker(self) -> Tracker:
        """Tracker of the setting, without a defect."""
        misplaced = None
        if self.changes.get("tilted"):
            misplaced = draw_misplaced_base(self.seed)
        return replace(
            Tracker(), misplaced=misplaced, **self.changes.get("tracker", {})
        )

    @property
    def weighs(self) -> bool:
        """Whether the arm has weights that are declared."""
        return HIDDEN_WEIGHT not in self.effects and self.changes.get("weighs", True)

    def declare_masses(self, arm: Arm) -> tuple[LinkMass, ...]:
        """Return the weights that are declared to the analyst: none if they are hidden
        or compensated."""
        return arm.masses if self.weighs else ()

    def build_specimen(self, robots_folder: str | Path) -> SimulatedRobot:
        """Build the robot of the setting, without the effects of the case."""
        arm = read_arm(self.robot_file(robots_folder))
        gravity_m_s2 = self.changes.get("gravity_m_s2", arm.gravity_m_s2)
        arm = replace(arm, gravity_m_s2=tuple(gravity_m_s2))
        robot = draw_specimen(
            arm,
            self.seed,
            weighs=self.weighs,
            off_line_m=self.changes.get("off_line_m", 0.0),
        )
        # Repeatabilities differ from joint to joint; the common error of a pose is the
        # same for all joints.
        factors = open_simulation_stream(self.seed, "repeatability").uniform(
            0.5, 1.5, arm.joints
        )
        return replace(
            robot,
            tracker=self._place_reflectors(arm),
            pose_rad=(self.changes.get("pose_rad", 0.0),) * arm.joints,
            repeatability_rad=tuple(self.changes.get("joint_rad", 0.0) * factors),
        )

    def _place_reflectors(self, arm: Arm) -> Tracker:
        """Return the tracker of the setting, with each target as far from its declared
        place as the setting says, in a random direction."""
        distance_m = self.changes.get("reflector_off_m")
        if not distance_m:
            return self.tracker
        draws = open_simulation_stream(self.seed, "reflectors")
        displacements_m = [
            tuple((distance_m * draw_direction(draws)).tolist()) for _ in arm.points
        ]
        return replace(self.tracker, reflectors_m=tuple(displacements_m))

    def robot_file(self, robots_folder: str | Path) -> Path:
        """Path of the robot file of which the robot is a specimen."""
        return Path(robots_folder) / f"{self.robot}.yaml"


class _Entry(NamedTuple):
    """A case of a plan before it has a robot and a seed; fields as of `BlindCase`, and
    a number that distinguishes its repetitions."""

    group: str
    effects: tuple[str, ...]
    levels: tuple[float, ...]
    setting: str
    number: int


def list_cases(plan: Plan, size: str, seed: int) -> list[BlindCase]:
    """List all cases of a benchmark, in the order of their names, which is random.

    Parameters
    ----------
    plan : mapping
        Contents of config/blind.yaml.
    size : str
        Name of a size of the plan.
    seed : int
        Another seed gives other cases.
    """
    benchmark = plan["sizes"][size]
    cases = []
    for part in benchmark["parts"]:
        for robot in part["robots"]:
            absent = set(find_absent_effects(plan, robot))
            cases += [
                _build_case(plan, robot, entry, benchmark.get("purpose", "blind"), seed)
                for entry in _list_entries(plan, part, robot, seed)
                if absent.isdisjoint(entry.effects)
            ]
    return sorted(cases, key=lambda case: case.name)


def _build_case(
    plan: Plan, robot: str, entry: _Entry, purpose: str, seed: int
) -> BlindCase:
    """Give an entry its robot, its key and the seed that follows from the key."""
    levels = [f"{level:g}" for level in entry.levels]
    words = [entry.group, robot, *entry.effects, *levels, entry.setting]
    key = "/".join([*words, str(entry.number)])
    digest = hashlib.sha256(f"{purpose}/{seed}/{key}".encode()).digest()
    return BlindCase(
        key,
        entry.group,
        robot,
        entry.effects,
        entry.levels,
        entry.setting,
        seed=int.from_bytes(digest[:6], "little"),
        robots=TUNED if robot in plan["tuned"] else PROOF,
        changes=plan["settings"][entry.setting],
    )


def draw_misplaced_base(seed: int) -> Motion:
    """Draw a base frame that was registered badly: it is tilted by about 0.3 mrad and
    shifted by about 0.2 mm, the same for all measurements."""
    draws = open_simulation_stream(seed, "tilted base")
    shift_m = _SHIFT_M * draws.standard_normal(3)
    turn_rad = _TILT_RAD * draws.standard_normal(3)
    return Motion(tuple(shift_m), tuple(turn_rad))


def find_absent_effects(plan: Plan, robot: str) -> tuple[str, ...]:
    """Look up the effects that a robot cannot have."""
    return tuple(plan["absent"].get(robot, ()))


def _list_entries(
    plan: Plan, part: Mapping[str, Any], robot: str, seed: int
) -> Iterator[_Entry]:
    """List the cases of a part of a benchmark on one robot."""
    single_effect_groups = [
        ("single", "usual", CATALOGUE_EFFECTS, part.get("levels", _LEVELS)),
        (
            "outside",
            "usual",
            OUTSIDE_EFFECTS,
            part.get("outside_levels", _OUTSIDE_LEVELS),
        ),
        (SEVERAL_JOINTS, "usual", MULTI_JOINT_EFFECTS, (_HIGH,)),
        (GEAR_GRAVITY, "usual", GEAR_EFFECTS, (_HIGH,)),
        (MOVED, "usual", ("setup_step",), (_HIGH, _KNOCKED)),
        (
            MOVED,
            "without_time_and_temperature",
            ("setup_step",),
            (_HIGH, _KNOCKED),
        ),
        (UNDECLARED, "usual", (HIDDEN_WEIGHT,), (_HEAVY,)),
        (REMAINS, "many_poses", _TWO_ANGLE_EFFECTS, (_REMAINING,)),
    ]
    for group, setting, effects, levels in single_effect_groups:
        repetitions = range(part.get(group, 0))
        for effect, level, number in product(effects, levels, repetitions):
            yield _Entry(group, (effect,), (level,), setting, number)
    for number in range(part.get("none", 0)):
        yield _Entry("none", (), (), "usual", number)
    pair_levels = part.get("pair_levels", _PAIR_LEVELS)
    for level, number in product(pair_levels, range(part.get("pair", 0))):
        pair = _draw_pair(plan, seed, robot, level, number)
        yield _Entry("pair", pair, (level, level), "usual", number)
    for setting, changes in plan["settings"].items():
        repetitions = range(part.get("setting", 0))
        without_covariate = (*changes.get("in_order", ()), *changes.get("hides", ()))
        for effect, number in product(without_covariate, repetitions):
            yield _Entry("setting", (effect,), (_HIGH,), setting, number)
        if setting == "usual" or without_covariate:
            continue
        # Without loads, many effects leave no trace in the measurements.
        with_effect = () if changes.get("without_effect") else repetitions
        for number in with_effect:
            effect = _draw_pair(plan, seed, robot, setting, number)[0]
            yield _Entry("setting", (effect,), (_SETTING_LEVEL,), setting, number)
        hard_cases = part.get("hard", 0) if changes.get("hard") else 0
        for number in range(max(len(repetitions), hard_cases)):
            yield _Entry("setting", (), (), setting, number)


def _draw_pair(
    plan: Plan, seed: int, robot: str, level: float | str, number: int
) -> tuple[str, str]:
    """Draw two different effects that the robot can have and of which none is an alias
    of the compliances."""
    excluded = ("force_scale", *find_absent_effects(plan, robot))
    possible = [effect for effect in CATALOGUE_EFFECTS if effect not in excluded]
    pairs = list(combinations(possible, 2))
    return pairs[
        open_simulation_stream(seed, f"pair {robot} {level} {number}").integers(
            len(pairs)
        )
    ]


class SizedDefect(NamedTuple):
    """A defect of the wanted non-centrality, and the entries of the ground truth that
    describe its size."""

    defect: Defect
    sizing: dict[str, Any]


def size_defects(
    case: BlindCase, noncentrality: NoncentralityModel
) -> list[SizedDefect]:
    """Draw the defects of a case and size them to their non-centralities.

    If a location has no size of the wanted non-centrality at which the arm comes to
    rest, or only one beyond three times the plausible size, the next location is drawn.
    If all eight are implausible, the least implausible one is chosen. If none has a
    size at all, as with a wrong force scale, the raw non-centrality is used instead,
    and the ground truth says so: no method can find such a defect. If even the largest
    meaningful size has a smaller raw non-centrality, the defect has that size.
    """
    sized_defects = []
    for order, effect in enumerate(case.effects):
        first_seed = case.seed + 1000 * order
        candidates = [
            _draw_defects(case, noncentrality.robot, effect, first_seed + draw)
            for draw in range(_DRAWS)
        ]
        sized_defects += _size_effect(noncentrality, candidates, case.levels[order])
    return sized_defects


def _size_effect(
    noncentrality: NoncentralityModel, candidates: list[list[Defect]], level: float
) -> list[SizedDefect]:
    """Choose one of the candidates, each a list of defects that belong together, and
    size it."""
    for quantity in ("retained", "raw"):
        sized = _find_first_plausible(noncentrality, candidates, level, quantity)
        if sized:
            return sized
    first = candidates[0]
    largest = KINDS[first[0].effect].largest
    if np.isinf(largest):
        raise ValueError(
            f"{first[0].effect} at {first[0].joints}:"
            f" no size has a non-centrality of {level:g}"
        )
    at_largest = [replace(defect, size=largest) for defect in first]
    return _describe_sizes(noncentrality, at_largest, level, "raw", 1)


def _draw_defects(
    case: BlindCase, robot: SimulatedRobot, effect: str, seed: int
) -> list[Defect]:
    """Draw defects of plausible size that belong together: one defect, or one mechanism
    at several joints."""
    arm = robot.arm
    kind = KINDS[effect]
    draws = open_simulation_stream(seed, f"joints of {effect}")
    locations = kind.locations(arm)
    if case.group == SEVERAL_JOINTS:
        count = draws.integers(min(_MIN_JOINTS, len(locations)), len(locations) + 1)
        indices = sorted(draws.choice(len(locations), count, replace=False).tolist())
        plausible = kind.scale_plausible_size(arm)
        return [
            Defect(
                effect,
                locations[index],
                plausible * draws.uniform(0.5, 1.5),
                seed + index,
            )
            for index in indices
        ]
    defect = draw_defect(effect, arm, seed)
    if case.group == UNDECLARED:
        # The last location of this effect consists of all links.
        defect = replace(defect, joints=locations[-1])
    if case.group == GEAR_GRAVITY:
        torque = compute_typical_gravity_torque(arm, arm.masses, arm.gravity_m_s2)
        loaded = np.flatnonzero(torque > _GRAVITY_SHARE * torque.max())
        defect = replace(defect, joints=(int(draws.choice(loaded)) + 1,))
    return [defect]


def build_noncentrality_model(
    case: BlindCase, robot: SimulatedRobot
) -> NoncentralityModel:
    """Build the measure of non-centrality of a case from its faultless robot."""
    return NoncentralityModel(
        robot,
        draw_schedule(robot.arm, case.design, case.seed),
        free_frame=case.design.frame == "tracker",
        declared=case.declare_masses(robot.arm),
    )


def _find_first_plausible(
    noncentrality: NoncentralityModel,
    candidates: list[list[Defect]],
    level: float,
    quantity: str,
) -> list[SizedDefect]:
    """Size the candidates until one needs no implausible size, and return it; otherwise
    return the least implausible one, or nothing if none has a size."""
    best: tuple[list[Defect], int] | None = None
    smallest_ratio = np.inf
    for draw, defects in enumerate(candidates, 1):
        largest = min(KINDS[defect.effect].largest / defect.size for defect in defects)
        build_robot = partial(apply_defects, noncentrality.robot, defects)
        try:
            factor = find_size(
                noncentrality, build_robot, 1.0, level, quantity, largest
            )
        except (ValueError, RuntimeError):
            # No size has this non-centrality, or the arm finds no equilibrium at a size
            # that the search tried.
            continue
        sized = [replace(defect, size=factor * defect.size) for defect in defects]
        ratio = max(_divide_by_plausible(noncentrality, defect) for defect in sized)
        if ratio < smallest_ratio:
            smallest_ratio = ratio
            best = sized, draw
        if ratio <= _MAX_PLAUSIBLE_RATIO:
            break
    if best is None:
        return []
    return _describe_sizes(noncentrality, best[0], level, quantity, best[1])


def find_size(
    noncentrality: NoncentralityModel,
    build_robot: Callable[[float], SimulatedRobot],
    start: float,
    target: float,
    quantity: str = "retained",
    largest: float = np.inf,
) -> float:
    """Find the size at which a defect has a non-centrality, to one per cent.

    The non-centrality of a linear effect grows with the square of its size; a secant
    method on the logarithms allows for other exponents.

    Parameters
    ----------
    noncentrality : NoncentralityModel
        Measure of non-centrality.
    build_robot : callable
        Returns the robot with the defect of a given size.
    start : float
        First size.
    target : float
        Wanted non-centrality.
    quantity : str
        "retained" after absorption by the declared model, or "raw".
    largest : float
        Upper bound of the size.

    Raises
    ------
    ValueError
        If no size up to the largest has the non-centrality: the declared model absorbs
        the defect at any size, its signal saturates, or it would have to be larger.
    """
    size = float(start)
    exponent = 2.0
    previous: tuple[float, float] | None = None
    for _ in range(_SECANT_STEPS):
        signal = noncentrality.compute_noncentralities(build_robot(size))
        value = signal[quantity]
        # An absorbed defect leaves rounding errors and second-order terms, a millionth
        # of the raw signal.
        if value <= 1e-6 * signal["raw"] or not np.isfinite(value):
            break
        if abs(value / target - 1.0) < 0.01:
            return size
        if previous is not None:
            slope = np.log(value / previous[1]) / np.log(size / previous[0])
            exponent = slope if 0.3 < slope < 8.0 else 2.0
        previous = (size, value)
        factor = float(np.clip((target / value) ** (1.0 / exponent), 0.02, 50.0))
        size = min(largest, size * factor)
        if size == previous[0]:
            break
    raise ValueError(
        f"no size found for a {quantity} non-centrality of {target:g}:"
        f" {value:.3g} of {signal['raw']:.3g} raw at {size:.3g}"
    )


def _describe_sizes(
    noncentrality: NoncentralityModel,
    defects: list[Defect],
    level: float,
    quantity: str,
    draw: int,
) -> list[SizedDefect]:
    """Describe the sizes of defects as the ground truth does, each with its own
    signal."""
    return [
        SizedDefect(
            defect,
            {
                "non_centrality": level,
                "of": quantity,
                "draw": draw,
                "signal": noncentrality.compute_noncentralities(
                    apply_defects(noncentrality.robot, [defect])
                ),
                "share_of_plausible": _divide_by_plausible(noncentrality, defect),
            },
        )
        for defect in defects
    ]


def _divide_by_plausible(noncentrality: NoncentralityModel, defect: Defect) -> float:
    """Divide the size of a defect by the plausible size on this arm."""
    return defect.size / KINDS[defect.effect].scale_plausible_size(
        noncentrality.robot.arm
    )


def write_sealed_case(
    case: BlindCase,
    blind_folder: str | Path,
    sealed_folder: str | Path,
    robots_folder: str | Path,
) -> str:
    """Write the campaign of a case and its sealed ground truth, and return the SHA-256
    of the latter.

    Parameters
    ----------
    case : BlindCase
        The case; both files have its name.
    blind_folder, sealed_folder : path
        Folders of campaigns and of ground truths.
    robots_folder : path
        Folder of robot files.
    """
    robot = case.build_specimen(robots_folder)
    sized_defects = []
    if case.effects:
        sized_defects = size_defects(case, build_noncentrality_model(case, robot))
    defective = apply_defects(robot, [sized.defect for sized in sized_defects])
    schedule = draw_schedule(robot.arm, case.design, case.seed)
    experiment = Experiment(defective, case.design, schedule)
    damage_rows = None
    if "bad_rows" in case.changes:
        damage_rows = partial(_damage_rows, case, experiment)
    folder = Path(blind_folder) / case.name
    record = write_blind_campaign(
        folder,
        case.name,
        case.robot_file(robots_folder),
        experiment,
        case.declare_masses(robot.arm),
        damage_rows,
    )
    truth: dict[str, Any] = {
        "case": asdict(case),
        "defects": [_describe_defect(robot, sized) for sized in sized_defects],
    }
    if robot.tracker.reflectors_m:
        truth["reflectors_m"] = list(map(list, robot.tracker.reflectors_m))
    misplaced = robot.tracker.misplaced
    if misplaced:
        truth["misplaced"] = {
            "shift_m": list(misplaced.shift_m),
            "turn_rad": list(misplaced.turn_rad),
        }
    path = Path(sealed_folder) / f"{case.name}.json"
    return write_truth(path, truth | record, folder)


def _damage_rows(
    case: BlindCase, experiment: Experiment, table: Table
) -> tuple[Table, list[Blunder]]:
    """Damage a few rows of a table, all in the same way."""
    draws = open_simulation_stream(case.seed, "bad rows")
    possible = [kind for kind in BLUNDER_KINDS if kind != "load" or table["load"].any()]
    kind = str(draws.choice(possible))
    count = int(draws.integers(1, case.changes["bad_rows"] + 1))
    return add_blunders(
        table, experiment.robot, experiment.schedule, kind, count, draws
    )


def _describe_defect(robot: SimulatedRobot, sized: SizedDefect) -> dict[str, Any]:
    """Describe a defect for the ground truth, with its parameters that the catalogue has
    too."""
    defect = sized.defect
    _, parameters = defect.on(robot)
    return (
        asdict(defect)
        | {
            "unit": KINDS[defect.effect].unit,
            "parameters": {name: float(value) for name, value in parameters.items()},
        }
        | sized.sizing
    )


def make_cases(job: Any) -> None:
    """Make a block of blind cases: campaigns for the analyst, and sealed ground
    truths."""
    params = job.params
    robots_folder = Path(job.input.robots[0]).parent
    for folder in (job.output.blind, job.output.sealed):
        Path(folder).mkdir(parents=True, exist_ok=True)
    cases = list_cases(params.plan, params.size, params.seed)
    blocks = params.plan["sizes"][params.size]["blocks"]
    for case in cases[params.number - 1 :: blocks]:
        write_sealed_case(case, job.output.blind, job.output.sealed, robots_folder)
