"""Robots as the analysis reads them, for comparison with the simulation's own
reader."""

from pathlib import Path

from elastocal.campaigns.reading import read_robot

ROBOTS = Path(__file__).resolve().parents[2] / "config" / "robots"


def analysed(name):
    """Read a robot of the repository by its name."""
    return read_robot(ROBOTS / f"{name}.yaml")
