"""What several subcommands need: parsing of quantities and of lists of numbers, output
to the terminal, the folders of the pipeline, of its robots and of its results, and
diagnosed campaigns."""

from __future__ import annotations

import math
import re
import shlex
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Option

from elastocal.errors import InputError, escape_control_characters

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import numpy as np
    from rich.console import Console

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.loop.calibrated_files import DiagnosedCampaign
    from elastocal.verdict import Verdict

_METRES = {"mm": 1e-3, "um": 1e-6, "µm": 1e-6, "m": 1.0}
_RADIANS = {
    "deg": math.radians(1.0),
    "°": math.radians(1.0),
    "rad": 1.0,
    "mrad": 1e-3,
    "urad": 1e-6,
    "µrad": 1e-6,
}
_QUANTITY = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*([a-zµ°]+)")
# Lower bound on lengths (m) and angles (rad): no instrument repeats better
# (`fitting.sensor_noise.FINEST_RESOLUTION`).
_SMALLEST = 1e-8
# Upper bounds on lengths and angles: tolerances and noise are never larger.
_LARGEST_M = 0.1
_LARGEST_RAD = 0.2
# Upper bounds on coordinates, as in a campaign: trackers stand up to a hundred metres
# away, targets within an arm's reach of their measuring point.
_FARTHEST_POINT_M = 1e3
FARTHEST_TARGET_M = 10.0
# Upper bounds on options. Seeds have 32 bits; larger numbers of poses, rows or lines are
# typing errors.
LARGEST_SEED = 2**32 - 1
MOST_POSES = 10_000
MOST_ROWS = 10_000_000
ForceOption = Annotated[
    bool,
    Option(
        "--force",
        help="Replace existing files, including those of other programs.",
    ),
]
# Options of commands that read tables of other programs.
AnglesOption = Annotated[
    str | None,
    Option(help="Unit of angles without a unit in the header: deg, rad, mrad."),
]
LengthsOption = Annotated[
    str | None,
    Option(help="Unit of lengths without a unit in the header: m, mm, um, in."),
]
RotationOption = Annotated[
    str | None,
    Option(
        help="none, vector, quaternion, matrix, homogeneous, euler:ZYX (moving axes),"
        " euler:xyz (fixed)."
    ),
]
ColumnOption = Annotated[
    list[str] | None,
    Option(help="NAME=HEADER, such as q1=Axis_A1; as often as needed."),
]
IgnoreOption = Annotated[
    list[str] | None,
    Option(help="Header of a column to leave out; as often as needed."),
]
UnitOption = Annotated[
    list[str] | None, Option(help="NAME=UNIT of one column, such as fx=kN.")
]
DecimalOption = Annotated[
    Literal["point", "comma"] | None,
    Option(help="Decimal mark. Default: detected."),
]
TargetsOption = Annotated[
    Path | None,
    Option(
        help="CSV that elastocal correct wrote. Default: targets.csv beside the"
        " measurements."
    ),
]
_SNAKEFILE = "Snakefile"
# Where a wheel installs the Snakefile, rules and configuration; see `data-files` in
# pyproject.toml.
_INSTALLED_SNAKEFILE = f"share/elastocal/{_SNAKEFILE}"


def parse_length_m(option: str, text: str) -> float:
    """Parse a length such as ``0.2mm``; refuse one without a unit, or of a size that no
    instrument or robot has."""
    allowed = "a length with its unit such as 0.2mm or 60um, 0.01 um to 0.1 m"
    return _parse_quantity(option, text, _METRES, _LARGEST_M, allowed)


def parse_angle_rad(option: str, text: str) -> float:
    """Parse an angle such as ``0.01deg``; refuse one without a unit, or of a size that
    no noise has."""
    allowed = "an angle with its unit such as 0.01deg or 60urad, 0.01 urad to 0.2 rad"
    return _parse_quantity(option, text, _RADIANS, _LARGEST_RAD, allowed)


def _parse_quantity(
    option: str, text: str, units: Mapping[str, float], largest: float, allowed: str
) -> float:
    match = _QUANTITY.fullmatch(text.strip())
    value = float(match[1]) * units.get(match[2], 0.0) if match else 0.0
    if not _SMALLEST <= value <= largest:
        raise InputError(option, "", repr(text), allowed)
    return value


def parse_numbers(
    option: str, text: str, count: int, largest: float = _FARTHEST_POINT_M
) -> np.ndarray:
    """Parse coordinates in metres that are separated by commas.

    Parameters
    ----------
    option : name of the option, for messages.
    text : text of its value.
    count : required number of coordinates.
    largest : upper bound on their sizes.
    """
    import numpy as np

    try:
        numbers = np.array([float(cell) for cell in text.split(",")])
    except ValueError:
        numbers = np.zeros(0)
    # The comparison is false for NaN, so NaN is refused, too.
    if len(numbers) != count or not (np.abs(numbers) <= largest).all():
        raise InputError(
            option,
            "",
            repr(text),
            f"{count} numbers separated by commas, each up to {largest:g} m",
        )
    return numbers


def parse_pairs(option: str, texts: Iterable[str] | None) -> dict[str, str]:
    """Parse options ``NAME=VALUE``, each name once."""
    pairs: dict[str, str] = {}
    for text in texts or ():
        name, _, value = map(str.strip, text.partition("="))
        if not (name and value) or name in pairs:
            raise InputError(option, "", repr(text), "NAME=VALUE, each name once")
        pairs[name] = value
    return pairs


def parse_units(
    units: Iterable[str] | None, angles: str | None, lengths: str | None
) -> dict[str, str]:
    """Parse the options --unit, --angles and --lengths, see
    `exchange.pose_table.TableOptions.units`."""
    stated = parse_pairs("--unit", units)
    if angles:
        stated["angles"] = angles
    if lengths:
        stated["lengths"] = lengths
    return stated


def format_example(command: str) -> str:
    """Format the end of a help text: a command to type, on a line that is not
    wrapped."""
    # \b keeps click from joining the lines of a paragraph.
    return f"\b\nExample:\n  {command}"


def format_command(*words: str | Path) -> str:
    """Format a command of elastocal so that a shell takes it as it is printed."""
    return shlex.join(["elastocal", *map(str, words)])


def print_answer(
    answer: str,
    details: Iterable[str],
    next_step: str,
    console: Console,
    *,
    passed: bool = True,
) -> None:
    """Print an answer with its mark, then details and the next command.

    Parameters
    ----------
    answer : first line; the mark is ✓ if `passed`, else !.
    details : lines below it; a warning begins with "! " already.
    next_step : the command that comes next, empty if there is none.
    console : where to print.
    """
    lines = [f"{'✓' if passed else '!'} {answer}"]
    for detail in details:
        lines.append(detail if detail.startswith("! ") else f"  {detail}")
    if next_step:
        lines.append(f"next: {next_step}")
    print_lines(lines, console)


def print_lines(lines: Iterable[str], console: Console) -> None:
    """Print lines as they are, but escape control characters, because the lines hold
    names and paths that other people have chosen."""
    for line in lines:
        console.print(
            escape_control_characters(line),
            markup=False,
            highlight=False,
            soft_wrap=True,
        )


def find_pipeline() -> Path:
    """Find the folder with the Snakefile: the checkout if there is one, else what this
    package has installed. An InputError is raised if there is none."""
    if checkout := _find_checkout():
        return checkout
    try:
        files = metadata.distribution("elastocal").files or []
    except metadata.PackageNotFoundError:
        files = []
    # The record of the wheel says where the installer has put the Snakefile.
    for file in files:
        if file.as_posix().endswith(_INSTALLED_SNAKEFILE):
            path = Path(str(file.locate())).resolve()
            if path.is_file():
                return path.parent
    allowed = (
        "a folder inside of a checkout of elastocal,"
        " or its wheel installed in an environment"
    )
    raise InputError(Path.cwd(), "", "no Snakefile here or above", allowed)


def find_robots_folder() -> Path:
    """Find the folder of the robot files that campaigns name."""
    return find_pipeline() / "config" / "robots"


def find_workplace() -> Path:
    """Find the folder of results/ and reports/: the checkout if there is one, else the
    working directory."""
    return _find_checkout() or Path.cwd()


def _find_checkout() -> Path | None:
    """Find a checkout at the working directory or above it, else the one from which this
    package is run."""
    for folder in (Path.cwd(), *Path.cwd().parents, *Path(__file__).resolve().parents):
        if (folder / _SNAKEFILE).is_file() and (folder / "config" / "robots").is_dir():
            return folder
    return None


def refuse_taken_name(name: str, source: str | Path) -> None:
    """Refuse the name of a campaign, read from `source` or to be written there, that is
    that of a campaign of this project. `diagnose` would refuse it after all has been
    measured: an InputError."""
    from elastocal.campaigns.importers import refuse_project_name
    from elastocal.io.documents import read_document

    path = find_pipeline() / "config.yaml"
    if path.is_file():
        refuse_project_name(name, read_document(path), source)


def load_diagnosed_campaign(folder: Path) -> DiagnosedCampaign:
    """Load a campaign with the results of its diagnosis, as `load_diagnosed`.

    Results of other versions of libraries come with a warning.
    """
    from rich.console import Console

    from elastocal.io.origin import list_versions
    from elastocal.loop.calibrated_files import load_diagnosed

    campaign = load_diagnosed(folder, find_robots_folder(), find_workplace())
    then = campaign.origin["environment"]
    now = list_versions(find_pipeline())
    changed = [name for name in sorted(then | now) if then.get(name) != now.get(name)]
    if changed:
        warning = (
            f"warning: {folder} was diagnosed with {_list_versions(then, changed)};"
            f" here are {_list_versions(now, changed)}"
        )
        print_lines([warning], Console(stderr=True))
    return campaign


@dataclass(frozen=True)
class Correctable:
    """A robot that can correct targets, from a diagnosed campaign or a model file.

    Attributes
    ----------
    name : name of its campaign.
    calibrated : the robot.
    verdict : verdict on the campaign.
    measures_poses : whether orientations were measured.
    files : files from which it comes.
    """

    name: str
    calibrated: CalibratedRobot
    verdict: Verdict
    measures_poses: bool
    files: list[str | Path]


def load_correctable(source: Path) -> Correctable:
    """Load a robot from the folder of a diagnosed campaign, or from a model file."""
    if source.is_file():
        from elastocal.application.model_file import read_model_file, restore_calibrated

        contents = read_model_file(source)
        return Correctable(
            contents.campaign,
            restore_calibrated(contents, source),
            contents.verdict,
            contents.fit.measures_poses,
            [source],
        )
    campaign = load_diagnosed_campaign(source)
    return Correctable(
        campaign.name,
        campaign.calibrated,
        campaign.verdict,
        campaign.case.campaign.measures_poses,
        [*campaign.folder.files()],
    )


def _list_versions(environment: Mapping[str, str], names: Iterable[str]) -> str:
    return ", ".join(f"{name} {environment.get(name, 'none')[:12]}" for name in names)
