"""What subcommands share: quantities with units and lists of numbers, how an answer is
printed, where the pipeline is that they run, with its robots, where its results are,
and a diagnosed campaign among them."""

from __future__ import annotations

import math
import re
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.errors import InputError, escape_control_characters

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import numpy as np
    from rich.console import Console

    from elastocal.loop.calibrated_files import Diagnosed

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
# m and rad: no instrument repeats better (`fitting.noise.FINEST_RESOLUTION`).
_LEAST = 1e-8
# Trackers stand at up to a hundred metres, targets within an arm's reach of where they
# are fixed, as in a campaign.
_FARTHEST_PLACE_M = 1e3
FARTHEST_TARGET_M = 10.0
# Draws are numbered in 32 bits; more poses, rows or lines than these are slips of the
# keyboard.
LARGEST_SEED = 2**32 - 1
MOST_POSES = 10_000
MOST_ROWS = 10_000_000


_SNAKEFILE = "Snakefile"
# Where a wheel has the Snakefile, rules and configuration; see `data-files` in
# pyproject.toml.
_INSTALLED = f"share/elastocal/{_SNAKEFILE}"


def length_m(option: str, text: str) -> float:
    """A length such as ``0.2mm`` in metres; refused without its unit, or of a size that
    no instrument or robot has."""
    return _quantity(
        option,
        text,
        _METRES,
        0.1,
        "a length with its unit such as 0.2mm or 60um, 0.01 um to 0.1 m",
    )


def angle_rad(option: str, text: str) -> float:
    """An angle such as ``0.01deg`` in rad; refused without its unit, or of a size that
    no noise has."""
    return _quantity(
        option,
        text,
        _RADIANS,
        0.2,
        "an angle with its unit such as 0.01deg or 60urad, 0.01 urad to 0.2 rad",
    )


def _quantity(
    option: str, text: str, units: Mapping[str, float], largest: float, allowed: str
) -> float:
    match = _QUANTITY.fullmatch(text.strip())
    value = float(match[1]) * units.get(match[2], 0.0) if match else 0.0
    if not _LEAST <= value <= largest:
        raise InputError(option, "", repr(text), allowed)
    return value


def numbers(
    option: str, text: str, count: int, largest: float = _FARTHEST_PLACE_M
) -> np.ndarray:
    """So many numbers separated by commas, metres, each of at most a size; anything
    else is refused."""
    import numpy as np

    try:
        found = np.array([float(part) for part in text.split(",")])
    except ValueError:
        found = np.zeros(0)
    # Not a number is no more than anything either.
    if len(found) != count or not (np.abs(found) <= largest).all():
        raise InputError(
            option,
            "",
            repr(text),
            f"{count} numbers separated by commas, each up to {largest:g} m",
        )
    return found


def example(command: str) -> str:
    """The end of a help text: a command to type, on a line that is not wrapped."""
    # \b keeps click from joining the lines of a paragraph.
    return f"\b\nExample:\n  {command}"


def print_answer(
    passed: bool, answer: str, details: Iterable[str], following: str, console: Console
) -> None:
    """Print an answer with its mark, ✓ or !, then its details and the command that
    comes next, if any.

    A detail that asks for attention begins with "! " already.
    """
    shown = [line if line.startswith("! ") else f"  {line}" for line in details]
    print_lines(
        [
            f"{'✓' if passed else '!'} {answer}",
            *shown,
            *([f"next: {following}"] if following else []),
        ],
        console,
    )


def print_lines(lines: Iterable[str], console: Console) -> None:
    """Print lines as they are, with what would steer a terminal as escapes: they hold
    names and paths of other people."""
    for line in lines:
        console.print(
            escape_control_characters(line),
            markup=False,
            highlight=False,
            soft_wrap=True,
        )


def pipeline() -> Path:
    """The folder with the Snakefile: of the checkout, where there is one, else what
    this package installed; none is refused."""
    if found := _checkout():
        return found
    try:
        files = metadata.distribution("elastocal").files or []
    except metadata.PackageNotFoundError:
        files = []
    # Wherever the installer has put it.
    for file in (
        Path(str(each.locate())).resolve()
        for each in files
        if each.as_posix().endswith(_INSTALLED)
    ):
        if file.is_file():
            return file.parent
    allowed = "a folder inside of a checkout of elastocal, or its wheel installed in an environment"
    raise InputError(Path.cwd(), "", "no Snakefile here or above", allowed)


def robots() -> Path:
    """The folder of the robot files that campaigns name."""
    return pipeline() / "config" / "robots"


def workplace() -> Path:
    """The folder in which results/ and reports/ are: the checkout, where there is one,
    else the working directory."""
    return _checkout() or Path.cwd()


def _checkout() -> Path | None:
    """The working directory or one above it, else the one that this package is run
    from."""
    for folder in (Path.cwd(), *Path.cwd().parents, *Path(__file__).resolve().parents):
        if (folder / _SNAKEFILE).is_file() and (folder / "config" / "robots").is_dir():
            return folder
    return None


def load_diagnosed_campaign(folder: Path) -> Diagnosed:
    """A campaign with what its diagnosis found, as `load_diagnosed`; results by other
    libraries or pins come with a warning."""
    from rich.console import Console

    from elastocal.io.origin import environment
    from elastocal.loop.calibrated_files import load_diagnosed

    found = load_diagnosed(folder, robots(), workplace())
    was = found.origin["environment"]
    now = environment(pipeline())
    if other := [name for name in sorted(was | now) if was.get(name) != now.get(name)]:
        there, here = (
            ", ".join(f"{name} {each.get(name, 'none')[:12]}" for name in other)
            for each in (was, now)
        )
        print_lines(
            [f"warning: {folder} was diagnosed with {there}; here are {here}"],
            Console(stderr=True),
        )
    return found
