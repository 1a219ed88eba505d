"""The cases of the blind proof as data, and the making of one: a campaign for the
analyst and a ground truth that is sealed.

A case is named by a hash, so that neither its folder nor its place in a list reveals
what is in it, and is seeded by its key: adding cases, or making them in another order
or in blocks, changes none that is there. Which cases there are says a plan, the
contents of config/blind.yaml.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np

from elastocal_proof.blind.folders import write_blind_campaign, write_truth
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
Sized = tuple[Defect, dict[str, Any]]

PROOF = "proof"
TUNED = "tuned"
CATALOGUE_EFFECTS = tuple(
    sorted(kind for kind in KINDS if not kind.startswith(OUTSIDE))
)
OUTSIDE_EFFECTS = tuple(sorted(kind for kind in KINDS if kind.startswith(OUTSIDE)))
# What hides the weight of the links from the analyst: a robot file that declares none,
# of an arm that has no other weight.
HIDDEN_WEIGHT = "link_weight"
SEVERAL_JOINTS = "several_joints"
GEAR_GRAVITY = "gear_gravity"
MOVED = "moved"
UNDECLARED = "undeclared"
# Errors that are smooth functions of two joints' angles, far beyond the noise:
# something repeatable remains, whatever is named.
REMAINS = "remains"
_OF_TWO_ANGLES = (OUTSIDE + "cable_pull", OUTSIDE + "two_angles")
_REMAINING = 1e4
# Mechanisms that come at several joints at once, as a bad mastering or one make of
# gears does.
MULTI_JOINT_EFFECTS = (
    *(
        "bearing_runout",
        "hysteresis",
        "joint_dependent_stiffness",
        "joint_offset",
        "joint_tilt",
        "link_elasticity",
    ),
    *("link_geometry", "lost_motion", "motor_eccentricity", "stiffening"),
    *("transmission_harmonic", "transmission_order", "transmission_ratio"),
)
_FEWEST_JOINTS = 3
# Gears whose laws see the weight, on the joints that carry more than a fifth of the
# most that any carries.
GEAR_EFFECTS = ("hysteresis", "joint_dependent_stiffness", "lost_motion", "stiffening")
_CARRIES = 0.2
_LEVELS = (25.0, 50.0, 200.0)
_FAR_LEVELS = (200.0,)
_PAIR_LEVELS = (50.0, 200.0)
_MIDDLE = 50.0
_HIGH = 200.0
# A stand that is knocked moves by a millimetre rather than by what can just be seen,
# and nobody's arm weighs a few kilograms.
_KNOCKED = 1e5
_HEAVY = 1e6
_DRAWS = 8
_ROUNDS = 12
# Of one axis, so that the whole is 0.3 mrad and 0.2 mm in the mean square.
_TILT_RAD = 3e-4 / np.sqrt(3.0)
_SHIFT_M = 2e-4 / np.sqrt(3.0)
# Times the plausible size.
_IMPLAUSIBLE = 3.0


@dataclass(frozen=True)
class BlindCase:
    """One case, from which its campaign and its ground truth follow.

    `key`: what it is; sealed. `robot`: robot file in config/robots. `robots`: `PROOF`
    or `TUNED`. `effects`: keys of `KINDS`. `levels`: non-centrality of each effect
    alone, after absorption; of one mechanism at several joints that of all together.
    `setting`: its name, and `changes`, what is other than usual in it, as in the plan.
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
        """Of its folder; reveals nothing."""
        return (
            "case_"
            + hashlib.sha256(f"{self.seed}/{self.key}".encode()).hexdigest()[:12]
        )

    @property
    def design(self) -> Design:
        """How its campaign is made."""
        changed: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value
            for key, value in self.changes.get("design", {}).items()
        }
        if ratio := self.changes.get("declared_ratio"):
            changed |= {
                "repeats": 1,
                "declared_noise": (
                    ratio * self.tracker.sigma_m,
                    ratio * self.tracker.sigma_rad,
                ),
            }
        return replace(Design(), **changed)

    @property
    def tracker(self) -> Tracker:
        """Its tracker, where nothing is wrong with it."""
        misplaced = (
            draw_misplaced_base(self.seed) if self.changes.get("tilted") else None
        )
        return replace(
            Tracker(), misplaced=misplaced, **self.changes.get("tracker", {})
        )

    @property
    def weighs(self) -> bool:
        """Whether the arm has weights that are declared."""
        return HIDDEN_WEIGHT not in self.effects and self.changes.get("weighs", True)

    def declared(self, arm: Arm) -> tuple[LinkMass, ...]:
        """Weights declared to the analyst: none where they are what is hidden, or
        compensated."""
        return arm.masses if self.weighs else ()

    def specimen(self, robots_folder: str | Path) -> SimulatedRobot:
        """Its robot before anything is wrong with it; its weights, its tracker and its
        drives are the setting's."""
        arm = read_arm(self.robot_file(robots_folder))
        arm = replace(
            arm, gravity_m_s2=tuple(self.changes.get("gravity_m_s2", arm.gravity_m_s2))
        )
        robot = draw_specimen(
            arm,
            self.seed,
            weighs=self.weighs,
            off_line_m=self.changes.get("off_line_m", 0.0),
        )
        # Repeatabilities differ from joint to joint, errors of a pose do not.
        spread = self.changes.get("joint_rad", 0.0) * open_simulation_stream(
            self.seed, "repeatability"
        ).uniform(0.5, 1.5, arm.joints)
        alike = (self.changes.get("pose_rad", 0.0),) * arm.joints
        return replace(
            robot, tracker=self.tracker, pose_rad=alike, repeatability_rad=tuple(spread)
        )

    def robot_file(self, robots_folder: str | Path) -> Path:
        """Of which its robot is a specimen."""
        return Path(robots_folder) / f"{self.robot}.yaml"


def list_cases(plan: Plan, size: str, seed: int) -> list[BlindCase]:
    """All cases of a benchmark, in the order of their names, that is in none; fresh
    seeds are fresh cases."""
    purpose = plan["sizes"][size].get("purpose", "blind")
    found = []
    for part in plan["sizes"][size]["parts"]:
        for robot in part["robots"]:
            for group, effects, levels, setting, number in _listed(
                plan, part, robot, seed
            ):
                if set(effects) & set(find_absent_effects(plan, robot)):
                    continue
                key = "/".join(
                    [
                        group,
                        robot,
                        *effects,
                        *(f"{level:g}" for level in levels),
                        setting,
                        str(number),
                    ]
                )
                drawn = int.from_bytes(
                    hashlib.sha256(f"{purpose}/{seed}/{key}".encode()).digest()[:6],
                    "little",
                )
                robots = TUNED if robot in plan["tuned"] else PROOF
                found.append(
                    BlindCase(
                        key,
                        group,
                        robot,
                        effects,
                        levels,
                        setting,
                        drawn,
                        robots,
                        plan["settings"][setting],
                    )
                )
    return sorted(found, key=lambda case: case.name)


def draw_misplaced_base(seed: int) -> Motion:
    """A base frame that was found badly: tilted by about 0.3 mrad and shifted by about
    0.2 mm, all measurements alike."""
    draws = open_simulation_stream(seed, "tilted base")
    return Motion(
        tuple(_SHIFT_M * draws.standard_normal(3)),
        tuple(_TILT_RAD * draws.standard_normal(3)),
    )


def find_absent_effects(plan: Plan, robot: str) -> tuple[str, ...]:
    """Effects that a robot cannot have."""
    return tuple(plan["absent"].get(robot, ()))


def _listed(
    plan: Plan, part: Mapping[str, Any], robot: str, seed: int
) -> Iterator[tuple[Any, ...]]:
    """Group, effects, levels, setting and number of each case of a part of a benchmark
    on one robot."""

    def each(name: str) -> range:
        return range(part.get(name, 0))

    for number in each("none"):
        yield "none", (), (), "usual", number
    for group, effects, levels in (
        ("single", CATALOGUE_EFFECTS, part.get("levels", _LEVELS)),
        ("outside", OUTSIDE_EFFECTS, part.get("outside_levels", _FAR_LEVELS)),
        (SEVERAL_JOINTS, MULTI_JOINT_EFFECTS, (_HIGH,)),
        (GEAR_GRAVITY, GEAR_EFFECTS, (_HIGH,)),
    ):
        for effect, level, number in product(effects, levels, each(group)):
            yield group, (effect,), (level,), "usual", number
    for setting, level, number in product(
        ("usual", "without_time_and_temperature"), (_HIGH, _KNOCKED), each(MOVED)
    ):
        yield MOVED, ("setup_step",), (level,), setting, number
    for number in each(UNDECLARED):
        yield UNDECLARED, (HIDDEN_WEIGHT,), (_HEAVY,), "usual", number
    for level, number in product(part.get("pair_levels", _PAIR_LEVELS), each("pair")):
        yield (
            "pair",
            _drawn_pair(plan, seed, robot, level, number),
            (level, level),
            "usual",
            number,
        )
    for setting, changes in plan["settings"].items():
        hidden = changes.get("hides", ())
        if setting != "usual" and not hidden:
            for number in range(
                max(
                    part.get("setting", 0),
                    part.get("hard", 0) if changes.get("hard") else 0,
                )
            ):
                yield "setting", (), (), setting, number
            for number in each("setting"):
                yield (
                    "setting",
                    _drawn_pair(plan, seed, robot, setting, number)[:1],
                    (_MIDDLE,),
                    setting,
                    number,
                )
        for number, effect in product(each("setting"), hidden):
            yield "setting", (effect,), (_HIGH,), setting, number
    for effect, number in product(_OF_TWO_ANGLES, each(REMAINS)):
        yield REMAINS, (effect,), (_REMAINING,), "many_poses", number


def _drawn_pair(
    plan: Plan, seed: int, robot: str, level: float | str, number: int
) -> tuple[str, str]:
    """Two effects of different names, neither of which is an alias of the compliances,
    and which the robot can have."""
    absent = ("force_scale", *find_absent_effects(plan, robot))
    pairs = list(
        combinations([name for name in CATALOGUE_EFFECTS if name not in absent], 2)
    )
    return pairs[
        open_simulation_stream(seed, f"pair {robot} {level} {number}").integers(
            len(pairs)
        )
    ]


def size_defects(
    case: BlindCase, robot: SimulatedRobot, yardstick: NoncentralityModel
) -> list[Sized]:
    """The defects of a case at the sizes that give their non-centralities, each with
    its size as in the ground truth.

    Where a location has no size of the wanted non-centrality at which the arm finds
    rest, or one beyond three times the plausible, the next one is drawn; of eight that
    are all implausible the least is taken. Where none has a size at all, as with a
    wrong force scale, the raw non-centrality is taken instead, and the ground truth
    states so: nothing can find that. Where even that is less at the largest size that
    means anything, it is that size.
    """
    found: list[Sized] = []
    for order, (effect, level) in enumerate(
        zip(case.effects, case.levels, strict=True)
    ):
        drawn = [
            _drawn(case, robot, effect, case.seed + 1000 * order + draw)
            for draw in range(_DRAWS)
        ]
        tries = (
            _first_plausible(yardstick, robot, drawn, level, quantity)
            for quantity in ("retained", "raw")
        )
        sized = next((each for each in tries if each), None)
        if sized is None:
            largest = [
                replace(defect, size=KINDS[effect].largest) for defect in drawn[0]
            ]
            if np.isinf(KINDS[effect].largest):
                raise ValueError(
                    f"{effect} at {drawn[0][0].joints}: no size has a non-centrality of {level:g}"
                )
            sized = _stated(yardstick, robot, largest, level, "raw", 1)
        found += sized
    return found


def _drawn(
    case: BlindCase, robot: SimulatedRobot, effect: str, seed: int
) -> list[Defect]:
    """Defects of plausible size that belong together: one, or one mechanism at several
    joints."""
    arm = robot.arm
    draws = open_simulation_stream(seed, f"joints of {effect}")
    kind = KINDS[effect]
    locations = kind.locations(arm)
    if case.group == SEVERAL_JOINTS:
        count = draws.integers(min(_FEWEST_JOINTS, len(locations)), len(locations) + 1)
        chosen = sorted(draws.choice(len(locations), count, replace=False).tolist())
        plausible = kind.scale_plausible_size(arm)
        return [
            Defect(
                effect,
                locations[place],
                plausible * draws.uniform(0.5, 1.5),
                seed + place,
            )
            for place in chosen
        ]
    defect = draw_defect(effect, arm, seed)
    if case.group == UNDECLARED:
        # The last of its locations: of all links.
        return [replace(defect, joints=locations[-1])]
    if case.group == GEAR_GRAVITY:
        torque = compute_typical_gravity_torque(arm, arm.masses, arm.gravity_m_s2)
        defect = replace(
            defect,
            joints=(
                int(draws.choice(np.flatnonzero(torque > _CARRIES * torque.max()))) + 1,
            ),
        )
    return [defect]


def build_yardstick(case: BlindCase, robot: SimulatedRobot) -> NoncentralityModel:
    """To which the defective robots of a case are compared; `robot`: faultless."""
    free = case.design.frame == "tracker"
    done = draw_schedule(robot.arm, case.design, case.seed)
    return NoncentralityModel(
        robot, done, free_frame=free, declared=case.declared(robot.arm)
    )


def _first_plausible(
    yardstick: NoncentralityModel,
    robot: SimulatedRobot,
    drawn: list[list[Defect]],
    level: float,
    quantity: str,
) -> list[Sized] | None:
    """The first of the drawn defects that need no implausible size, or else the least
    implausible; None where none have any."""
    least: tuple[float, list[Defect], int] | None = None
    for number, defects in enumerate(drawn, 1):
        largest = min(KINDS[defect.effect].largest / defect.size for defect in defects)
        try:
            factor = find_size(
                yardstick,
                partial(apply_defects, robot, defects),
                1.0,
                level,
                quantity,
                largest,
            )
        except (ValueError, RuntimeError):
            # No size has it, or on the way to it the arm finds no rest.
            continue
        sized = [replace(defect, size=factor * defect.size) for defect in defects]
        share = max(_share_of_plausible(robot, defect) for defect in sized)
        if least is None or share < least[0]:
            least = share, sized, number
        if share <= _IMPLAUSIBLE:
            break
    return (
        None
        if least is None
        else _stated(yardstick, robot, least[1], level, quantity, least[2])
    )


def find_size(
    yardstick: NoncentralityModel,
    robot_of_size: Callable[[float], SimulatedRobot],
    start: float,
    target: float,
    quantity: str = "retained",
    largest: float = np.inf,
) -> float:
    """Size of a defect at which its non-centrality, "retained" or "raw", is the target
    to one per cent.

    `robot_of_size`: robot with the defect of a given size. Raises `ValueError`: no size
    up to the largest has it: the defect is absorbed whatever its size, saturates, or
    would be larger than allowed.

    The non-centrality of a linear effect grows with the square of its size; the secant
    of the logarithms allows for others.
    """
    size = float(start)
    exponent = 2.0
    last: tuple[float, float] | None = None
    for _ in range(_ROUNDS):
        signal = yardstick.compute_noncentralities(robot_of_size(size))
        value = signal[quantity]
        # What is absorbed leaves rounding and second order, a millionth of the raw
        # signal.
        if value <= 1e-6 * signal["raw"] or not np.isfinite(value):
            break
        if abs(value / target - 1.0) < 0.01:
            return size
        if last is not None and last[0] != size:
            slope = np.log(value / last[1]) / np.log(size / last[0])
            exponent = slope if 0.3 < slope < 8.0 else 2.0
        last = (size, value)
        size = min(
            largest,
            size * float(np.clip((target / value) ** (1.0 / exponent), 0.02, 50.0)),
        )
        if size == last[0]:
            break
    found = f"{value:.3g} of {signal['raw']:.3g} raw at {size:.3g}"
    raise ValueError(
        f"no size found for a {quantity} non-centrality of {target:g}: {found}"
    )


def _stated(
    yardstick: NoncentralityModel,
    robot: SimulatedRobot,
    defects: list[Defect],
    level: float,
    quantity: str,
    draw: int,
) -> list[Sized]:
    """Defects with their sizes as in the ground truth, each with its own signal."""
    found: list[Sized] = []
    for defect in defects:
        signal = yardstick.compute_noncentralities(apply_defects(robot, [defect]))
        share = _share_of_plausible(robot, defect)
        sizing = {
            "non_centrality": level,
            "of": quantity,
            "draw": draw,
            "signal": signal,
            "share_of_plausible": share,
        }
        found.append((defect, sizing))
    return found


def _share_of_plausible(robot: SimulatedRobot, defect: Defect) -> float:
    return defect.size / KINDS[defect.effect].scale_plausible_size(robot.arm)


def write_sealed_case(
    case: BlindCase,
    blind_folder: str | Path,
    sealed_folder: str | Path,
    robots_folder: str | Path,
) -> str:
    """Make the campaign of a case and its sealed ground truth, by its name in each
    folder; returns the SHA-256 of that."""
    robot = case.specimen(robots_folder)
    design = case.design
    yardstick = build_yardstick(case, robot) if case.effects else None
    sized = size_defects(case, robot, yardstick) if yardstick else []
    bad = apply_defects(robot, [defect for defect, _ in sized])
    folder = Path(blind_folder) / case.name
    schedule = draw_schedule(robot.arm, design, case.seed)

    def slipped(table: Table) -> tuple[Table, list[Blunder]]:
        """One to so many bad rows, of one kind."""
        draws = open_simulation_stream(case.seed, "bad rows")
        possible = [
            kind for kind in BLUNDER_KINDS if kind != "load" or table["load"].any()
        ]
        kind = str(draws.choice(possible))
        count = int(draws.integers(1, case.changes["bad_rows"] + 1))
        return add_blunders(table, bad, schedule, kind, count, draws)

    file = case.robot_file(robots_folder)
    slips = slipped if "bad_rows" in case.changes else None
    made = write_blind_campaign(
        folder, case.name, file, bad, design, schedule, case.declared(robot.arm), slips
    )
    truth: dict[str, Any] = {"case": asdict(case), "defects": []}
    for defect, sizing in sized:
        # Those that are comparable with the catalogue's.
        parameters = {name: float(value) for name, value in defect.on(robot)[1].items()}
        stated = asdict(defect) | {
            "unit": KINDS[defect.effect].unit,
            "parameters": parameters,
        }
        truth["defects"].append(stated | sizing)
    if misplaced := robot.tracker.misplaced:
        truth["misplaced"] = {
            "shift_m": list(misplaced.shift_m),
            "turn_rad": list(misplaced.turn_rad),
        }
    return write_truth(Path(sealed_folder) / f"{case.name}.json", truth | made, folder)


def make_cases(job: Any) -> None:
    """A block of blind cases: campaigns for the analyst, and their ground truths,
    sealed."""
    asked = job.params
    robots = Path(job.input.robots[0]).parent
    for folder in (job.output.blind, job.output.sealed):
        Path(folder).mkdir(parents=True, exist_ok=True)
    cases = list_cases(asked.plan, asked.size, asked.seed)
    blocks = asked.plan["sizes"][asked.size]["blocks"]
    for case in cases[asked.number - 1 :: blocks]:
        write_sealed_case(case, job.output.blind, job.output.sealed, robots)
