"""Robots as the analysis reads them, for comparison with the plant's own reading."""

from pathlib import Path

from elastocal.campaigns.reading import read_robot

ROBOTS = Path(__file__).resolve().parents[2] / "config" / "robots"


def analysed(name):
    """Robot of elastocal.mechanics.robot."""
    return read_robot(ROBOTS / f"{name}.yaml")
