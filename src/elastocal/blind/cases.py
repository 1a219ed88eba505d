"""The cases of the blind proof as data, and the making of one: a campaign for the analyst and a truth that is sealed.

A case is named by a hash, so that neither its folder nor its place in a list tells what is in it, and is seeded by its key:
adding cases, or making them in another order or in blocks, changes none that is there.
"""

import hashlib
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations, product
from pathlib import Path

from elastocal.plant.arm import arm_from_file
from elastocal.plant.campaigns import Design, schedule_of
from elastocal.plant.defects import KINDS, OUTSIDE, Defect, drawn_defect, truth_of, with_defects
from elastocal.plant.drives import Repeatability
from elastocal.plant.folders import write_blind_campaign, write_truth
from elastocal.plant.physical_robot import specimen
from elastocal.plant.random_numbers import stream
from elastocal.plant.sizing import Yardstick, size_for
from elastocal.plant.tracker import Tracker
from elastocal.whole_files import appearing_whole

PROOF, TUNED = ("fanuc", "abb"), ("kuka",)
ROBOTS = (*TUNED, *PROOF)
LEVELS = (10.0, 25.0, 50.0, 200.0)
NAMED = tuple(sorted(kind for kind in KINDS if not kind.startswith(OUTSIDE)))
FOREIGN = tuple(sorted(kind for kind in KINDS if kind.startswith(OUTSIDE)))
_DRAWS = 8
# Times the plausible size.
_IMPLAUSIBLE = 3.0

# Of every case whose setting says nothing else.
USUAL_DESIGN = Design()

# Settings by name: what is other than usual about the design, the tracker and the drives.
SETTINGS = {
    "usual": {},
    # Without repeats there is nothing but the word of the campaign.
    **{f"declared_noise_times_{ratio:g}": {"declared_ratio": ratio} for ratio in (0.5, 0.8, 0.9, 1.1, 1.5)},
    "repeatability": {"joint_rad": 2e-5},
    "repeatability_without_moves": {"joint_rad": 2e-5, "design": {"approach_each_load": False}},
    "range_dependent_noise": {"tracker": {"sigma_m": 1.5e-5, "sigma_m_per_m": 6e-6}},
    "unknown_frame": {"design": {"frame": "tracker"}, "tracker": {"frame_turn": (0.1, -0.05, 0.8)}},
    "outliers_1_percent": {"tracker": {"outliers": 0.01}},
    "outliers_2_percent": {"tracker": {"outliers": 0.02}},
    "outliers_5_percent": {"tracker": {"outliers": 0.05}},
    "outliers_2_percent_far": {"tracker": {"outliers": 0.02, "outlier_sigmas": 30.0}},
    "without_approach": {"design": {"covariates": ("time", "temperature")}},
    "without_time_and_temperature": {"design": {"covariates": ("approach",)}},
    "without_covariates": {"design": {"covariates": ()}},
}
# Designs of the confounding sweep, by name: the fewer points, loads and the narrower the joints, the more alike effects are.
SWEEP_DESIGNS = {
    f"{points}, {loads}, {joints}": {"design": read | loaded | reached}
    for points, read in (("all points", {}), ("flange", {"points": ("6DoF",)}))
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
SWEEP_LEVEL = 50.0
_HARD_NULLS = tuple(name for name in SETTINGS if name != "usual" and not name.startswith("without"))
# Effects that cannot be seen without what a setting leaves out.
_UNSEEN = {
    "without_approach": ("hysteresis",),
    "without_time_and_temperature": ("frame_drift", "thermal_growth"),
    "without_covariates": ("hysteresis", "frame_drift", "thermal_growth"),
}


@dataclass(frozen=True)
class Case:
    """One case, from which its campaign and its truth follow.

    Attributes
    ----------
    key : str
        What it is; sealed.
    group : {"none", "single", "pair", "outside", "setting", "sweep"}
    robot : str
        Robot file in config/robots.
    effects : tuple of str
        Keys of `defects.KINDS`.
    levels : tuple of float
        Non-centrality of each effect alone, on the poses that are not held out, after the compliances have absorbed theirs.
    setting : str
        Key of `SETTINGS`, or of `SWEEP_DESIGNS` in a sweep.
    seed : int
    rival : str
        In a sweep the near relative of the effect; otherwise empty.
    """

    key: str
    group: str
    robot: str
    effects: tuple
    levels: tuple
    setting: str
    seed: int
    rival: str = ""

    @property
    def name(self):
        """Of its folder; tells nothing."""
        return "case_" + hashlib.sha256(f"{self.seed}/{self.key}".encode()).hexdigest()[:12]


@dataclass(frozen=True)
class Counts:
    """How many cases of each kind on each robot.

    Attributes
    ----------
    none : int
    single : int
        Of each effect of the catalogue at each of `levels`.
    outside : int
        Of each effect that is not there at each of `outside_levels`.
    pair : int
        Of drawn pairs at each of `pair_levels`.
    setting : int
        Without an effect, of each hard setting; with one at non-centrality 50, of each setting; and of effects that a setting
        hides, each.
    sweep : int
        Of each effect of each of `SWEEP_PAIRS` under each of `SWEEP_DESIGNS`.
    also : tuple of Counts
        Of other robots.
    """

    none: int
    single: int
    outside: int
    pair: int
    setting: int
    levels: tuple = LEVELS
    outside_levels: tuple = (50.0, 200.0)
    pair_levels: tuple = (50.0, 200.0)
    robots: tuple = field(default=ROBOTS)
    sweep: int = 0
    also: tuple = ()


SIZES = {
    "smoke": Counts(none=2, single=0, outside=0, pair=1, setting=0, robots=("kuka",)),
    "quick": Counts(none=20, single=1, outside=1, pair=5, setting=1, levels=(50.0, 200.0), robots=PROOF),
    # On the two robots of the proof together 520 nulls, at a true rate of 5 % a 95 % interval of 3.3 to 7.2 %; 40 cases of each
    # effect at each level, 150 pairs at each. On the robot on which the method was tuned a few of each, to compare.
    "full": Counts(
        none=260,
        single=20,
        outside=20,
        pair=75,
        setting=8,
        sweep=1,
        outside_levels=(200.0,),
        robots=PROOF,
        also=(Counts(none=60, single=3, outside=4, pair=12, setting=2, outside_levels=(200.0,), robots=TUNED),),
    ),
}


def cases_of(counts, seed):
    """All cases of a benchmark.

    Parameters
    ----------
    counts : Counts
    seed : int
        Fresh seeds are fresh cases.

    Returns
    -------
    list of Case
        In the order of their names, that is in none.
    """
    found = []

    def add(group, robot, effects, levels, setting, number, rival=""):
        words = [group, robot, *effects, *(f"{level:g}" for level in levels), setting, str(number), *([rival] if rival else [])]
        key = "/".join(words)
        digest = hashlib.sha256(f"blind/{seed}/{key}".encode()).digest()
        found.append(Case(key, group, robot, effects, levels, setting, int.from_bytes(digest[:6], "little"), rival))

    for share, robot in [(part, robot) for part in (counts, *counts.also) for robot in part.robots]:
        for number in range(share.none):
            add("none", robot, (), (), "usual", number)
        for group, effects, levels, count in (
            ("single", NAMED, share.levels, share.single),
            ("outside", FOREIGN, share.outside_levels, share.outside),
        ):
            for effect, level, number in product(effects, levels, range(count)):
                add(group, robot, (effect,), (level,), "usual", number)
        for level in share.pair_levels:
            for number in range(share.pair):
                add("pair", robot, _drawn_pair(seed, robot, level, number), (level, level), "usual", number)
        for number in range(share.setting):
            for setting in _HARD_NULLS:
                add("setting", robot, (), (), setting, number)
                add("setting", robot, _drawn_pair(seed, robot, setting, number)[:1], (50.0,), setting, number)
            for setting, effects in _UNSEEN.items():
                for effect in effects:
                    add("setting", robot, (effect,), (200.0,), setting, number)
        for effect, rival in (*SWEEP_PAIRS, *(pair[::-1] for pair in SWEEP_PAIRS)):
            for design in SWEEP_DESIGNS:
                for number in range(share.sweep):
                    add("sweep", robot, (effect,), (SWEEP_LEVEL,), design, number, rival)
    return sorted(found, key=lambda case: case.name)


def block_of(cases, number, of):
    """Every `of`-th case from `number` on, both counted from 1 as people do: a share for one job of a cluster."""
    return cases[number - 1 :: of]


def design_of(case):
    """How the campaign of a case is made."""
    setting = _setting(case)
    design = replace(USUAL_DESIGN, **setting.get("design", {}))
    if "declared_ratio" in setting:
        tracker = replace(Tracker(), **setting.get("tracker", {}))
        noise = tuple(setting["declared_ratio"] * sigma for sigma in (tracker.sigma_m, tracker.sigma_rad))
        design = replace(design, repeats=1, declared_noise=noise)
    return design


def _setting(case):
    return (SWEEP_DESIGNS if case.group == "sweep" else SETTINGS)[case.setting]


def specimen_of(case, robots_folder):
    """The robot of a case before anything is wrong with it; its tracker and its drives' repeatability are the setting's.

    Parameters
    ----------
    case : Case
    robots_folder : str or Path

    Returns
    -------
    PhysicalRobot
    """
    robot, setting = specimen(arm_from_file(Path(robots_folder) / f"{case.robot}.yaml"), case.seed), _setting(case)
    robot = replace(robot, tracker=replace(robot.tracker, **setting.get("tracker", {})))
    if "joint_rad" in setting:
        spread = setting["joint_rad"] * stream(case.seed, "repeatability").uniform(0.5, 1.5, robot.arm.joints)
        robot = replace(robot, drives=(Repeatability(tuple(spread)),))
    return robot


def defects_of(case, robot, design):
    """The defects of a case at the sizes that give their non-centralities.

    Parameters
    ----------
    case : Case
    robot : PhysicalRobot
        Faultless.
    design : Design

    Returns
    -------
    list of (Defect, dict)
        Each with what the truth says of its size: target, quantity, signal, which draw.

    Notes
    -----
    Where a place has no size of the wanted non-centrality, or one beyond three times the plausible, the next one is drawn; of
    eight that are all implausible the least is taken. Where none has a size at all, as with a wrong force scale, the raw
    non-centrality is taken instead, and the truth says so: nothing can find that.
    """
    yardstick = _yardstick(case, robot, design)
    found = []
    for order, (effect, level) in enumerate(zip(case.effects, case.levels, strict=True)):
        drawn = [drawn_defect(effect, robot.arm, case.seed + 1000 * order + draw) for draw in range(_DRAWS)]
        sized = _first_plausible(yardstick, robot, drawn, level, "retained") or _first_plausible(
            yardstick, robot, drawn, level, "raw"
        )
        if sized is None:
            raise ValueError(f"{case.key}: no {effect} has a non-centrality of {level:g}")
        found.append(sized)
    return found


def angle_to_rival(case, robot, design, bad):
    """Smallest angle between what a case's defects and its rival, wherever that may sit, make off the compliances, degrees.

    Parameters
    ----------
    case : Case
        Of a sweep.
    robot, bad : PhysicalRobot
        Without and with the defects.
    design : Design

    Returns
    -------
    float
    """
    kind, yardstick = KINDS[case.rival], _yardstick(case, robot, design)

    def at(place):
        """Rivals whose details differ and which together span what there is at a place."""
        defects = [Defect(case.rival, place, kind.plausible, case.seed + draw) for draw in range(_DRAWS)]
        return [with_defects(robot, [defect]) for defect in defects]

    return min(yardstick.angle_deg(bad, at(place)) for place in kind.places(robot.arm))


def _yardstick(case, robot, design):
    targets = [robot.arm.points.index(point) for point in design.points] or None
    return Yardstick(robot, schedule_of(robot.arm, design, case.seed), targets, free_frame=design.frame == "tracker")


def _first_plausible(yardstick, robot, drawn, level, quantity):
    """The first of the drawn defects that needs no implausible size, or else the least implausible; None where none has any."""
    least = None
    for number, defect in enumerate(drawn, 1):

        def robot_of_size(size, defect=defect):
            return with_defects(robot, [replace(defect, size=size)])

        try:
            size, signal = size_for(yardstick, robot_of_size, defect.size, level, quantity, KINDS[defect.effect].largest)
        except ValueError:
            continue
        share = size / KINDS[defect.effect].plausible
        told = {"non_centrality": level, "of": quantity, "draw": number, "share_of_plausible": share, "signal": asdict(signal)}
        if least is None or share < least[1]["share_of_plausible"]:
            least = (replace(defect, size=size), told)
        if share <= _IMPLAUSIBLE:
            break
    return least


def make_case(case, blind_folder, sealed_folder, robots_folder):
    """Make the campaign and the truth of a case.

    Parameters
    ----------
    case : Case
    blind_folder, sealed_folder : str or Path
        The campaign goes to ``blind_folder/<name>/``, the truth to ``sealed_folder/<name>.json``.
    robots_folder : str or Path

    Returns
    -------
    str
        SHA-256 of the truth.
    """
    robot, design = specimen_of(case, robots_folder), design_of(case)
    sized = defects_of(case, robot, design)
    bad = with_defects(robot, [defect for defect, _ in sized])
    folder = Path(blind_folder) / case.name
    made = write_blind_campaign(folder, case.name, case.robot, bad, design, schedule_of(robot.arm, design, case.seed))
    truth = {"case": asdict(case), "defects": [truth_of(robot, defect) | told for defect, told in sized]}
    if case.rival:
        truth["rival"] = {"effect": case.rival, "angle_deg": angle_to_rival(case, robot, design, bad)}
    return write_truth(Path(sealed_folder) / f"{case.name}.json", truth | made, folder)


def write_manifest(path, digests):
    """Write the commitment that is published before any diagnosis: a line ``sha256  name`` for each truth.

    Parameters
    ----------
    path : str or Path
    digests : dict of str to str
        By the name of the case.
    """
    with appearing_whole(path) as partial, open(partial, "w", encoding="utf-8") as file:
        file.writelines(f"{digest}  {name}.json\n" for name, digest in sorted(digests.items()))


def _drawn_pair(seed, robot, level, number):
    """Two effects of different names, neither of which is an alias of the compliances."""
    pairs = list(combinations([name for name in NAMED if name != "force_scale"], 2))
    return pairs[stream(seed, f"pair {robot} {level} {number}").integers(len(pairs))]
