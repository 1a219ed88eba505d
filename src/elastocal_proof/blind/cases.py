"""The cases of the blind proof as data, and the making of one: a campaign for the analyst and a ground truth that is sealed.

A case is named by a hash, so that neither its folder nor its place in a list reveals what is in it, and is seeded by its key:
adding cases, or making them in another order or in blocks, changes none that is there.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import combinations, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.io.atomic_writes import write_text
from elastocal_proof.blind.folders import write_blind_campaign, write_truth
from elastocal_proof.plant.arm import Arm, LinkMass, arm_from_file
from elastocal_proof.plant.bad_rows import possible_kinds, with_bad_rows
from elastocal_proof.plant.campaigns import FLANGE, Design, schedule_of
from elastocal_proof.plant.defects import KINDS, OUTSIDE, Defect, drawn_defect, truth_of, with_defects
from elastocal_proof.plant.drives import PoseError, Repeatability
from elastocal_proof.plant.physical_robot import PhysicalRobot, specimen
from elastocal_proof.plant.random_numbers import stream
from elastocal_proof.plant.sizing import Yardstick, size_for
from elastocal_proof.plant.tracker import Tracker, misplaced_base
from elastocal_proof.plant.weights import declared_masses, on_stretches, usual_gravity_torque

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from elastocal_proof.plant.bad_rows import BadReading
    from elastocal_proof.plant.physical_robot import Schedule

    _Sized = tuple[Defect, dict[str, Any]]

# Robot files of config/robots. Nobody has looked at a diagnosis of the first two before the engine was frozen.
PROOF, TUNED = ("panda", "m900ib700"), ("kuka", "fanuc", "abb", "iiwa14", "gp180")
ROBOTS = (*TUNED, *PROOF)
# What an arm without a gravity compensator cannot have.
_WITHOUT_COMPENSATOR: dict[str, tuple[str, ...]] = dict.fromkeys(
    ("iiwa14", "panda"), ("compensator_torque", "compensator_stiffness")
)
_LEVELS = (10.0, 25.0, 50.0, 200.0)
NAMED = tuple(sorted(kind for kind in KINDS if not kind.startswith(OUTSIDE)))
FOREIGN = tuple(sorted(kind for kind in KINDS if kind.startswith(OUTSIDE)))
# What hides the weight of the links from the analyst: a robot file that declares none, of an arm that has no other weight.
_WEIGHT = "link_weight"
SEVERAL_JOINTS, GEAR_GRAVITY, MOVED, UNDECLARED = "several_joints", "gear_gravity", "moved", "undeclared"
# Mechanisms that come at several joints at once, as a bad mastering or one make of gears does.
WIDESPREAD = (
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
_FEWEST_JOINTS = 3
# Gears whose laws see the weight, on the joints that carry more than a fifth of the most that any carries.
OF_GEARS = ("hysteresis", "joint_dependent_stiffness", "lost_motion", "stiffening")
_CARRIES = 0.2
_HIGH = 200.0
# A stand that is knocked moves by a millimetre rather than by what can just be seen, and nobody's arm weighs a few kilograms.
_KNOCKED, _HEAVY = 1e5, 1e6
_MOVED_SETUP = "setup_step"
_DRAWS = 8
# Times the plausible size.
_IMPLAUSIBLE = 3.0

# Of every case whose setting says nothing else.
USUAL_DESIGN = Design()

# Settings by name: what is other than usual about the design, the tracker and the drives.
SETTINGS: dict[str, dict[str, Any]] = {
    "usual": {},
    # Without repeats there is nothing but the word of the campaign.
    **{f"declared_noise_times_{ratio:g}": {"declared_ratio": ratio} for ratio in (0.5, 0.8, 0.9, 1.1, 1.5)},
    "pose_common_15urad": {"declared_ratio": 1.0, "pose_rad": 1.5e-5},
    # Three times the usual force: 3 kN at an arm of 140 kg and more.
    "force_3kN": {"design": {"force_times": 3.0}},
    "off_line_centres": {"off_line_m": 0.06},
    "outliers_2_percent": {"tracker": {"outliers": 0.02}},
    "on_a_wall": {"gravity_m_s2": (9.80665, 0.0, 0.0)},
    "weight_compensated": {"weighs": False},
    "repeatability": {"joint_rad": 2e-5},
    "repeatability_without_moves": {"joint_rad": 2e-5, "design": {"approach_each_load": False}},
    "range_dependent_noise": {"tracker": {"sigma_m": 1.5e-5, "sigma_m_per_m": 6e-6}},
    "unknown_frame": {"design": {"frame": "tracker"}, "tracker": {"frame_turn": (0.1, -0.05, 0.8)}},
    "outliers_1_percent": {"tracker": {"outliers": 0.01}},
    "outliers_5_percent": {"tracker": {"outliers": 0.05}},
    "outliers_2_percent_far": {"tracker": {"outliers": 0.02, "outlier_sigmas": 30.0}},
    # 1 to 3 rows that a lost beam or a slipped decimal point spoiled, and a base that is not quite where it is declared.
    "bad_rows": {"bad_rows": 3},
    "tilted_base": {"tilted": True},
    # Nobody declares how soft the joints are, and few poses of an afternoon.
    "unknown_compliances": {"design": {"undeclared": ("compliance_urad_per_Nm",)}},
    "twelve_poses": {"design": {"poses": 17, "held_out": 5, "repeated_poses": 5}},
    "without_approach": {"design": {"covariates": ("time", "temperature")}},
    "without_time_and_temperature": {"design": {"covariates": ("approach",)}},
    "without_covariates": {"design": {"covariates": ()}},
}
# Designs of the confounding sweep, by name: the fewer points, loads and the narrower the joints, the more alike effects are.
SWEEP_DESIGNS: dict[str, dict[str, Any]] = {
    f"{points}, {loads}, {joints}": {"design": read | loaded | reached}
    for points, read in (("all points", {}), ("flange", {"points": (FLANGE,)}))
    for loads, loaded in (("ladder", {}), ("one load", {"ladder": (0.0, 1.0)}))
    for joints, reached in (("wide", {}), ("narrow", {"reach": 0.25}))
}
# Near relatives of the catalogue.
SWEEP_PAIRS = (
    ("stiffening", "lost_motion"),
    ("joint_tilt", "link_elasticity"),
    ("base_compliance", "link_elasticity"),
    ("payload", "link_weight"),
    ("compensator_stiffness", "joint_dependent_stiffness"),
    ("link_geometry", "thermal_growth"),
)
_SWEEP_LEVEL = 50.0
# Of which the proof counts false alarms by the hundred.
HARD = (
    "pose_common_15urad",
    "force_3kN",
    "off_line_centres",
    "outliers_2_percent",
    "bad_rows",
    "tilted_base",
    "unknown_compliances",
    "twelve_poses",
)
_HARD_NULLS = tuple(name for name in SETTINGS if name != "usual" and not name.startswith("without"))
# Effects that cannot be seen without what a setting leaves out.
_UNSEEN: dict[str, tuple[str, ...]] = {
    "without_approach": ("hysteresis",),
    "without_time_and_temperature": ("frame_drift", "temperature_gradient", "thermal_growth"),
    "without_covariates": ("hysteresis", "frame_drift", "temperature_gradient", "thermal_growth"),
}


@dataclass(frozen=True)
class Case:
    """One case, from which its campaign and its ground truth follow.

    `key`: what it is; sealed. `group`: such as "none", "single", "pair" or "moved". `robot`: robot file in config/robots.
    `effects`: keys of `defects.KINDS`.
    `levels`: non-centrality of each effect alone, on the poses that are not held out, after the compliances and the weights
    have absorbed theirs; of one mechanism at several joints that of all together. `setting`: key of `SETTINGS`, or of
    `SWEEP_DESIGNS` in a sweep. `alternative`: in a sweep the near relative of the effect; otherwise empty.
    """

    key: str
    group: str
    robot: str
    effects: tuple[str, ...]
    levels: tuple[float, ...]
    setting: str
    seed: int
    alternative: str = ""

    @property
    def name(self) -> str:
        """Of its folder; reveals nothing."""
        return "case_" + hashlib.sha256(f"{self.seed}/{self.key}".encode()).hexdigest()[:12]


@dataclass(frozen=True)
class Counts:
    """How many cases of each kind on each robot.

    `single`: of each effect of the catalogue at each of `levels`. `outside`: of each effect that is not there at each of
    `outside_levels`. `pair`: of drawn pairs at each of `pair_levels`. `setting`: without an effect, of each hard setting; with
    one at non-centrality 50, of each setting; and of effects that a setting hides, each. `sweep`: of each effect of each of
    `SWEEP_PAIRS` under each of `SWEEP_DESIGNS`. `hard`: without an effect, of each setting of `HARD`. `several_joints`: of each
    of `WIDESPREAD` at three and more joints. `gear_gravity`: of each of `OF_GEARS` on a joint that carries weight. `moved`: of
    set-ups that move between rows, by little and by a millimetre, with and without the time written down, each. `undeclared`:
    of arms whose robot file declares no weight of any link. `also`: of other robots. `purpose`: of cases that must be none of
    another size, whatever the seeds.
    """

    none: int
    single: int
    outside: int
    pair: int
    setting: int
    levels: tuple[float, ...] = _LEVELS
    outside_levels: tuple[float, ...] = (50.0, 200.0)
    pair_levels: tuple[float, ...] = (50.0, 200.0)
    robots: tuple[str, ...] = field(default=ROBOTS)
    sweep: int = 0
    hard: int = 0
    several_joints: int = 0
    gear_gravity: int = 0
    moved: int = 0
    undeclared: int = 0
    also: tuple[Counts, ...] = ()
    purpose: str = ""


_ONE_OF_EACH = Counts(
    none=20,
    single=1,
    outside=1,
    pair=4,
    setting=1,
    several_joints=1,
    gear_gravity=1,
    moved=1,
    undeclared=1,
    outside_levels=(_HIGH,),
)
_LEVELS_OF_PROOF = (25.0, 50.0, _HIGH)
SIZES = {
    "smoke": Counts(none=2, single=0, outside=0, pair=1, setting=0, robots=("kuka",)),
    "quick": replace(_ONE_OF_EACH, levels=(50.0,), robots=("fanuc",)),
    # To develop on: all groups on all robots that are not those of the proof. Its cases are in no other size.
    "development": replace(_ONE_OF_EACH, pair=6, hard=3, levels=_LEVELS_OF_PROOF, robots=TUNED, purpose="development"),
    # On the two robots of the proof together 1000 nulls, at a true rate of 2.5 % a 95 % interval of 1.6 to 3.7 %, and 200 of
    # each hard setting; 16 cases of each effect at each level, 200 pairs at each, where 92 % have a lower limit of 87 %. On the
    # robots on which the method was developed a few of each, to compare.
    "full": Counts(
        none=500,
        single=8,
        outside=10,
        pair=100,
        setting=3,
        sweep=1,
        hard=100,
        several_joints=8,
        gear_gravity=25,
        moved=5,
        undeclared=5,
        levels=_LEVELS_OF_PROOF,
        outside_levels=(_HIGH,),
        robots=PROOF,
        also=(replace(_ONE_OF_EACH, none=30, pair=5, setting=0, moved=0, undeclared=0, levels=(50.0, _HIGH), robots=TUNED),),
    ),
}


def cases_of(counts: Counts, seed: int) -> list[Case]:
    """All cases of a benchmark.

    `seed`: fresh seeds are fresh cases. Returns in the order of their names, that is in none.
    """
    found: list[Case] = []

    def add(
        group: str, effects: tuple[str, ...], levels: tuple[float, ...], setting: str, number: int, alternative: str = ""
    ) -> None:
        if set((*effects, alternative)) & set(impossible_on(robot)):
            return
        words = [group, robot, *effects, *(f"{level:g}" for level in levels), setting, str(number)]
        key = "/".join(words + [alternative] * bool(alternative))
        digest = hashlib.sha256(f"{counts.purpose or 'blind'}/{seed}/{key}".encode()).digest()
        found.append(Case(key, group, robot, effects, levels, setting, int.from_bytes(digest[:6], "little"), alternative))

    for share, robot in [(part, robot) for part in (counts, *counts.also) for robot in part.robots]:
        for number in range(share.none):
            add("none", (), (), "usual", number)
        for group, effects, levels, count in (
            ("single", NAMED, share.levels, share.single),
            ("outside", FOREIGN, share.outside_levels, share.outside),
            (SEVERAL_JOINTS, WIDESPREAD, (_HIGH,), share.several_joints),
            (GEAR_GRAVITY, OF_GEARS, (_HIGH,), share.gear_gravity),
        ):
            for effect, level, number in product(effects, levels, range(count)):
                add(group, (effect,), (level,), "usual", number)
        for setting, level, number in product(("usual", "without_time_and_temperature"), (_HIGH, _KNOCKED), range(share.moved)):
            add(MOVED, (_MOVED_SETUP,), (level,), setting, number)
        for number in range(share.undeclared):
            add(UNDECLARED, (_WEIGHT,), (_HEAVY,), "usual", number)
        for level in share.pair_levels:
            for number in range(share.pair):
                add("pair", _drawn_pair(seed, robot, level, number), (level, level), "usual", number)
        for setting in _HARD_NULLS:
            for number in range(max(share.setting, share.hard if setting in HARD else 0)):
                add("setting", (), (), setting, number)
        for number in range(share.setting):
            for setting in _HARD_NULLS:
                add("setting", _drawn_pair(seed, robot, setting, number)[:1], (50.0,), setting, number)
            for setting, effects in _UNSEEN.items():
                for effect in effects:
                    add("setting", (effect,), (_HIGH,), setting, number)
        for effect, alternative in (*SWEEP_PAIRS, *(pair[::-1] for pair in SWEEP_PAIRS)):
            for design in SWEEP_DESIGNS:
                for number in range(share.sweep):
                    add("sweep", (effect,), (_SWEEP_LEVEL,), design, number, alternative)
    return sorted(found, key=lambda case: case.name)


def impossible_on(robot: str) -> tuple[str, ...]:
    """Effects that a robot of `ROBOTS` cannot have, tuple of str."""
    return _WITHOUT_COMPENSATOR.get(robot, ())


def block_of(cases: list[Case], number: int, of: int) -> list[Case]:
    """Every `of`-th case from `number` on, both counted from 1 as people do: a share for one job of a cluster."""
    return cases[number - 1 :: of]


def design_of(case: Case) -> Design:
    """How the campaign of a case is made."""
    setting = _setting(case)
    design = replace(USUAL_DESIGN, **setting.get("design", {}))
    if "declared_ratio" in setting:
        tracker = replace(Tracker(), **setting.get("tracker", {}))
        ratio = setting["declared_ratio"]
        noise = ratio * tracker.sigma_m, ratio * tracker.sigma_rad
        design = replace(design, repeats=1, declared_noise=noise)
    return design


def _setting(case: Case) -> dict[str, Any]:
    return (SWEEP_DESIGNS if case.group == "sweep" else SETTINGS)[case.setting]


def specimen_of(case: Case, robots_folder: str | Path) -> PhysicalRobot:
    """The robot of a case before anything is wrong with it; its weights, its tracker and its drives are the setting's."""
    arm, setting = arm_from_file(robot_file(case, robots_folder)), _setting(case)
    arm = replace(arm, gravity_m_s2=setting.get("gravity_m_s2", arm.gravity_m_s2))
    robot = specimen(arm, case.seed, weighs=_weighs(case), off_line_m=setting.get("off_line_m", 0.0))
    robot = replace(robot, tracker=replace(robot.tracker, **setting.get("tracker", {})))
    if setting.get("tilted"):
        robot = replace(robot, tracker=replace(robot.tracker, misplaced=misplaced_base(stream(case.seed, "tilted base"))))
    for key, purpose, law in (("joint_rad", "repeatability", Repeatability), ("pose_rad", "pose errors", PoseError)):
        if key in setting:
            # Repeatabilities differ from joint to joint, errors of a pose do not.
            spread = stream(case.seed, purpose).uniform(0.5, 1.5, arm.joints) if law is Repeatability else np.ones(arm.joints)
            robot = replace(robot, drives=(*robot.drives, law(tuple(setting[key] * spread))))
    return robot


def robot_file(case: Case, robots_folder: str | Path) -> Path:
    """Of which the robot of a case is a specimen."""
    return Path(robots_folder) / f"{case.robot}.yaml"


def declared_of(case: Case, arm: Arm) -> tuple[LinkMass, ...]:
    """Weights declared to the analyst, tuple of LinkMass: none where they are what is hidden, or compensated."""
    return declared_masses(arm) if _weighs(case) else ()


def _weighs(case: Case) -> bool:
    return _WEIGHT not in case.effects and _setting(case).get("weighs", True)


def defects_of(case: Case, robot: PhysicalRobot, design: Design) -> list[_Sized]:
    """The defects of a case at the sizes that give their non-centralities.

    `robot`: faultless. Returns (Defect, dict): each with its size as in the ground truth: target, quantity, signal, which draw.
    Of one mechanism at several joints each has its own signal; the target is that of all together.

    Where a location has no size of the wanted non-centrality, or one beyond three times the plausible, the next one is
    drawn; of eight that are all implausible the least is taken. Where none has a size at all, as with a wrong force scale, the
    raw non-centrality is taken instead, and the ground truth states so: nothing can find that. Where even that is less at the
    largest size that means anything, it is that size.
    """
    if not case.effects:
        return []
    yardstick = yardstick_of(case, robot, design)
    found: list[_Sized] = []
    for order, (effect, level) in enumerate(zip(case.effects, case.levels, strict=True)):
        drawn = [_drawn(case, robot, effect, case.seed + 1000 * order + draw) for draw in range(_DRAWS)]
        sized = _first_plausible(yardstick, robot, drawn, level, "retained") or _first_plausible(
            yardstick, robot, drawn, level, "raw"
        )
        found += sized or _largest(yardstick, robot, drawn[0], level)
    return found


def _drawn(case: Case, robot: PhysicalRobot, effect: str, seed: int) -> list[Defect]:
    """Defects of plausible size that belong together: one, or one mechanism at several joints."""
    arm, draws = robot.arm, stream(seed, f"joints of {effect}")
    if case.group == SEVERAL_JOINTS:
        locations = KINDS[effect].locations(arm)
        count = draws.integers(min(_FEWEST_JOINTS, len(locations)), len(locations) + 1)
        chosen, plausible = sorted(draws.choice(len(locations), count, replace=False)), KINDS[effect].plausible_on(arm)
        return [
            Defect(effect, locations[location], plausible * draws.uniform(0.5, 1.5), seed + location) for location in chosen
        ]
    defect = drawn_defect(effect, arm, seed)
    if case.group == UNDECLARED:
        # The last of its locations: of all links.
        return [replace(defect, joints=KINDS[effect].locations(arm)[-1])]
    if case.group == GEAR_GRAVITY:
        torque = usual_gravity_torque(arm, on_stretches(declared_masses(arm), arm), arm.gravity_m_s2)
        defect = replace(defect, joints=(int(draws.choice(np.flatnonzero(torque > _CARRIES * torque.max()))) + 1,))
    return [defect]


def angle_to_alternative(case: Case, robot: PhysicalRobot, design: Design, bad: PhysicalRobot) -> float:
    """Smallest angle between the contributions of a case's defects and of its alternative at any location, degrees.

    `case`: of a sweep. `robot`, `bad`: without and with the defects.
    """
    kind, yardstick = KINDS[case.alternative], yardstick_of(case, robot, design)

    def at(location: tuple[int, ...]) -> list[PhysicalRobot]:
        """Alternatives whose details differ and which together span what there is at a location."""
        defects = [Defect(case.alternative, location, kind.plausible_on(robot.arm), case.seed + draw) for draw in range(_DRAWS)]
        return [with_defects(robot, [defect]) for defect in defects]

    return min(yardstick.angle_deg(bad, at(location)) for location in kind.locations(robot.arm))


def yardstick_of(case: Case, robot: PhysicalRobot, design: Design) -> Yardstick:
    """To which the defective robots of a case are compared; `robot`: faultless."""
    targets = [robot.arm.points.index(point) for point in design.targets_on(robot.arm)]
    return Yardstick(
        robot,
        schedule_of(robot.arm, design, case.seed),
        targets,
        free_frame=design.frame == "tracker",
        declared=declared_of(case, robot.arm),
    )


def _first_plausible(
    yardstick: Yardstick, robot: PhysicalRobot, drawn: Iterable[list[Defect]], level: float, quantity: str
) -> list[_Sized] | None:
    """The first of the drawn defects that need no implausible size, or else the least implausible; None where none have any."""
    least: tuple[float, list[_Sized]] | None = None
    for number, defects in enumerate(drawn, 1):

        def times(factor: float, defects: list[Defect] = defects) -> list[Defect]:
            return [replace(defect, size=factor * defect.size) for defect in defects]

        def robot_of_size(factor: float, times: Callable[[float], list[Defect]] = times) -> PhysicalRobot:
            return with_defects(robot, times(factor))

        largest = min(KINDS[defect.effect].largest / defect.size for defect in defects)
        try:
            factor, _ = size_for(yardstick, robot_of_size, 1.0, level, quantity, largest)
        except ValueError:
            continue
        sized = times(factor)
        share = max(_share_of_plausible(robot, defect) for defect in sized)
        if least is None or share < least[0]:
            least = share, _stated(yardstick, robot, sized, level, quantity, number)
        if share <= _IMPLAUSIBLE:
            break
    return None if least is None else least[1]


def _largest(yardstick: Yardstick, robot: PhysicalRobot, defects: list[Defect], level: float) -> list[_Sized]:
    """Defects at the largest size that means anything."""
    for defect in defects:
        if np.isinf(KINDS[defect.effect].largest):
            raise ValueError(f"{defect.effect} at {defect.joints}: no size has a non-centrality of {level:g}")
    sized = [replace(defect, size=KINDS[defect.effect].largest) for defect in defects]
    return _stated(yardstick, robot, sized, level, "raw", 1)


def _stated(
    yardstick: Yardstick, robot: PhysicalRobot, defects: list[Defect], level: float, quantity: str, draw: int
) -> list[_Sized]:
    """Defects with their sizes as in the ground truth, each with its own signal."""
    found: list[_Sized] = []
    for defect in defects:
        sizing = {"non_centrality": level, "of": quantity, "draw": draw}
        signal = asdict(yardstick.signal(with_defects(robot, [defect])))
        found.append((defect, sizing | {"share_of_plausible": _share_of_plausible(robot, defect), "signal": signal}))
    return found


def _share_of_plausible(robot: PhysicalRobot, defect: Defect) -> float:
    return defect.size / KINDS[defect.effect].plausible_on(robot.arm)


def make_case(case: Case, blind_folder: str | Path, sealed_folder: str | Path, robots_folder: str | Path) -> str:
    """Make the campaign and the ground truth of a case.

    `blind_folder`, `sealed_folder`: the campaign goes to ``blind_folder/<name>/``, the ground truth to
    ``sealed_folder/<name>.json``. Returns SHA-256 of the ground truth.
    """
    robot, design = specimen_of(case, robots_folder), design_of(case)
    sized = defects_of(case, robot, design)
    bad = with_defects(robot, [defect for defect, _ in sized])
    folder = Path(blind_folder) / case.name
    schedule, declared = schedule_of(robot.arm, design, case.seed), declared_of(case, robot.arm)
    slipped = partial(_slipped, case, bad, schedule) if "bad_rows" in _setting(case) else None
    made = write_blind_campaign(
        folder, case.name, robot_file(case, robots_folder), bad, design, schedule, declared, slipped=slipped
    )
    truth = {"case": asdict(case), "defects": [truth_of(robot, defect) | sizing for defect, sizing in sized]}
    if robot.tracker.misplaced is not None:
        misplaced = robot.tracker.misplaced
        truth["misplaced"] = {"shift_m": list(misplaced.shift_m), "turn_rad": list(misplaced.turn_rad)}
    if case.alternative:
        truth["alternative"] = {"effect": case.alternative, "angle_deg": angle_to_alternative(case, robot, design, bad)}
    return write_truth(Path(sealed_folder) / f"{case.name}.json", truth | made, folder)


def _slipped(
    case: Case, robot: PhysicalRobot, schedule: Schedule, table: dict[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], list[BadReading]]:
    """A table with up to so many bad rows as the setting says, of one kind."""
    draws = stream(case.seed, "bad rows")
    kind, count = draws.choice(possible_kinds(table)), draws.integers(1, _setting(case)["bad_rows"] + 1)
    return with_bad_rows(table, robot, schedule, str(kind), int(count), draws)


def write_manifest(path: str | Path, digests: Mapping[str, str]) -> None:
    """Write the commitment that is published before any diagnosis: a line ``sha256  name`` for each ground truth.

    `digests`: by the name of the case.
    """
    write_text(path, "".join(f"{digest}  {name}.json\n" for name, digest in sorted(digests.items())))


def _drawn_pair(seed: int, robot: str, level: float | str, number: int) -> tuple[str, str]:
    """Two effects of different names, neither of which is an alias of the compliances, and which the robot can have."""
    absent = ("force_scale", *impossible_on(robot))
    pairs = list(combinations([name for name in NAMED if name not in absent], 2))
    return pairs[stream(seed, f"pair {robot} {level} {number}").integers(len(pairs))]
