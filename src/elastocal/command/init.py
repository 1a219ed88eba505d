"""`elastocal init`: a campaign's folder to begin with."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from elastocal.command.printed import print_answer
from elastocal.errors import InputError


def init(
    folder: Annotated[Path, Argument(help="New folder, or one that has measurements or a robot file already.")],
    robot: Annotated[Path | None, Option(help="Robot file to copy there; a template where there is none.")] = None,
) -> None:
    """Begin a campaign: a folder with files to fill in.

    campaign.yaml explains every key, and has the targets of measurements that lie there. No file that exists is replaced.
    """
    from rich.console import Console

    from elastocal.campaigns.campaign import DOCUMENT
    from elastocal.campaigns.measurements import CSV, PARQUET, described_by
    from elastocal.campaigns.reading import read_robot
    from elastocal.campaigns.template import campaign_template, robot_template, sheet_template
    from elastocal.io.atomic_writes import check_places, write_text, write_together
    from elastocal.io.documents import LARGEST_BYTES
    from elastocal.io.texts import read_text

    place = folder / "robot.yaml"
    check_places(place, *(folder / name for name in (DOCUMENT, CSV, PARQUET)))
    if (folder / DOCUMENT).exists():
        raise InputError(folder / DOCUMENT, "", "a campaign that is there already", "a folder without campaign.yaml")
    if robot is not None and place.exists():
        raise InputError(place, "", "a robot that is there already", "a folder without robot.yaml, or no --robot")
    text = robot_template() if robot is None else read_text(robot, LARGEST_BYTES)
    source = place if place.exists() else robot
    arm = None if source is None else read_robot(source)
    there = [name for name in (place.name, CSV, PARQUET) if (folder / name).exists()]
    targets, measured = described_by(folder)
    written = [name for name in (place.name, CSV, DOCUMENT) if name not in there and (name != CSV or PARQUET not in there)]
    with write_together(folder, written) as partial:
        if place.name in written:
            write_text(partial / place.name, text)
        arm = arm or read_robot(partial / place.name)
        if CSV in written:
            write_text(partial / CSV, sheet_template(arm.joints))
        write_text(partial / DOCUMENT, campaign_template(folder.resolve().name, arm, targets, measured))
    template = ["! robot.yaml is a template: enter your robot's chain and lengths, or use `elastocal import urdf` or `dh`"]
    answer = f"{folder.as_posix()}: {', '.join(written)}"
    first = "check campaign.yaml for the frame and where targets sit" if targets else "fill in measurements.csv"
    following = f"{first}, then elastocal check {folder.as_posix()}"
    print_answer(True, answer, template if source is None else [], following, Console())
