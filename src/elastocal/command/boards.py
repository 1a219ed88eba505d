"""`elastocal board` prints a board, and `elastocal detect` finds it in images."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from typer import Argument, Option

from elastocal.command.terminal import format_command, print_answer
from elastocal.counting import format_count
from elastocal.errors import InputError

# Images that are named one by one before the rest is counted.
_NAMED_IMAGES = 5


def board(
    *,
    pdf: Annotated[
        Path, Option(help="The sheet to print; board.yaml is written beside it.")
    ],
    kind: Annotated[
        Literal["charuco", "apriltag"],
        Option(help="A chessboard with markers, or a grid of AprilTags."),
    ] = "charuco",
    paper: Annotated[Literal["a4", "letter"], Option(help="The paper.")] = "a4",
    columns: Annotated[int, Option(min=2, max=50, help="Squares in a row.")] = 7,
    rows: Annotated[int, Option(min=2, max=50, help="Rows of squares.")] = 9,
    square: Annotated[float, Option(help="Side of a square in mm.")] = 25.0,
    force: Annotated[bool, Option("--force", help="Replace files.")] = False,
) -> None:
    """Print a board for a camera, to scale.

    Print it at 100 %, lay a rule on the line under the board, and glue the sheet onto
    something flat, such as glass: a bent board is seen as an error of the robot.
    """
    from rich.console import Console

    from elastocal.errors import explain_missing_packages
    from elastocal.exchange.board_pattern import format_pattern, make_pattern
    from elastocal.io.atomic_writes import write_atomically, write_text

    if not 0.0 < square <= 1000.0:
        raise InputError("--square", "", f"{square:g}", "a length in mm up to 1000")
    description = pdf.parent / "board.yaml"
    for path in (pdf, description):
        if path.exists() and not force:
            raise InputError(path, "", "a file that is there already", "--force")
    pattern = make_pattern(kind, columns, rows, 1e-3 * square)
    with explain_missing_packages():
        from elastocal.figures.board import draw_board
    figure = draw_board(pattern, paper)
    pdf.parent.mkdir(parents=True, exist_ok=True)
    with write_atomically(pdf) as partial:
        figure.savefig(partial, format="pdf")
    write_text(description, format_pattern(pattern))
    print_answer(
        f"{pdf.as_posix()}: {kind}, {columns} x {rows} squares of {square:g} mm",
        [
            f"{description.as_posix()}: the same for elastocal detect",
            "print at 100 %; the line under the board must be 100 mm long",
        ],
        format_command("detect", "images", "--board", description, "-o", "boards.csv"),
        Console(),
    )


def detect(
    images: Annotated[
        Path, Argument(help="Folder of images, in the order of the poses.")
    ],
    *,
    board: Annotated[Path, Option(help="board.yaml, as elastocal board writes it.")],
    output: Annotated[
        Path, Option("--output", "-o", help="Table of poses to write.")
    ] = Path("boards.csv"),
    intrinsics: Annotated[
        Path | None,
        Option(
            help="Intrinsic parameters of the camera (camera_info of ROS, YAML)."
            " Default: from the same images, written beside the table as camera.yaml."
        ),
    ] = None,
) -> None:
    """Find a board in images: its pose in the camera, with residual and standard error.

    An image without the board, with a large residual or with two poses that fit as well
    gets no row, and is named.
    """
    from rich.console import Console

    from elastocal.exchange.board_detection import (
        detect_boards,
        find_images,
        summarize_detection,
        write_poses,
    )
    from elastocal.exchange.board_pattern import read_pattern
    from elastocal.exchange.camera_file import format_camera, read_camera
    from elastocal.io.atomic_writes import write_atomically, write_text

    pattern = read_pattern(board)
    camera = read_camera(intrinsics) if intrinsics else None
    detection = detect_boards(find_images(images), pattern, camera)
    with write_atomically(output) as partial:
        write_poses(partial, detection.poses)
    medians = summarize_detection(detection)
    details = [
        f"median residual {medians['residual_px']:.2f} px; standard error"
        f" {1e3 * medians['position_m']:.2f} mm,"
        f" {1e3 * medians['orientation_rad']:.2f} mrad an axis",
        f"written: {output.as_posix()}",
    ]
    if camera is None:
        path = output.parent / "camera.yaml"
        write_text(path, format_camera(detection.camera))
        details.append(f"written: {path.as_posix()}, the camera from the same images")
    left_out = [f"{name}: {reason}" for name, reason in detection.left_out.items()]
    details += [f"! left out: {line}" for line in left_out[:_NAMED_IMAGES]]
    if len(left_out) > _NAMED_IMAGES:
        details.append(f"! and {len(left_out) - _NAMED_IMAGES} more images left out")
    print_answer(
        f"{format_count(len(detection.poses), 'pose')} of the board in"
        f" {format_count(len(detection.poses) + len(left_out), 'image')}",
        details,
        format_command(
            "import",
            "board",
            output,
            *("--joints", "joints.csv", "--angles", "rad"),
            *("--folder", "campaigns/arm", "--robot", "robot.yaml"),
        ),
        Console(),
    )
