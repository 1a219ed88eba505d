"""Campaigns: simulated ones drawn again, the split of the poses, and seals of the blind
proof."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import numpy as np
import pandas as pd
import pinocchio as pin
import yaml

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.finished_run import (
    POSITION,
    WRENCH,
    Finding,
    FinishedRun,
    compare,
    open_philox_stream,
    require,
)

# Positions are some metres, rotations some radians; near half a turn rotation vectors
# lose digits.
_DIGITS = 1e-10


def check_simulated_campaign(
    run: FinishedRun, file: str, campaign: str
) -> Iterator[Finding]:
    """Every angle, load and noise of a simulated campaign from its stream, every pose
    of the elastic arm by pinocchio."""
    path = run.folder / f"config/campaigns/{campaign}.yaml"
    source = yaml.safe_load(path.read_text("utf-8")) if path.is_file() else {}
    if source.get("source") != "simulated":
        return
    document = yaml.safe_load(
        (run.folder / f"config/robots/{source['robot']}.yaml").read_text("utf-8")
    )
    arm = Arm(document)
    draws = open_philox_stream(run.seed, campaign, "campaign")
    table = run.table(file)
    low, high = np.deg2rad(document["joint_limits_deg"]).T
    angles = low + (high - low) * draws.random((source["poses"], arm.joints))
    normal = draws.standard_normal((source["poses"], 3))
    forces = source["force_N"] * normal / np.linalg.norm(normal, axis=1)[:, None]
    # Without load and under the whole one the first poses are approached again and
    # again.
    visits = [
        (pose, load, repeat)
        for pose in range(source["poses"])
        for load in range(len(source["ladder"]))
        for repeat in range(
            source["repeats"] if pose < source["repeated_poses"] and load < 2 else 1
        )
    ]
    pose, load, _ = np.transpose(visits)
    of_pose = angles[pose]
    force = np.array(source["ladder"])[load, None] * forces[pose]
    wrenches = np.concatenate([force, np.cross(source["offset_m"], force)], axis=1)
    loaded = [
        arm.loaded(arm.springs, *each, 1)[0]
        for each in zip(of_pose, wrenches, strict=True)
    ]
    for point in source["points"]:
        position, turned = (draws.standard_normal((len(visits), 3)) for _ in range(2))
        exact = [arm.pose(coordinates, point) for coordinates in loaded]
        seen = [
            (
                *(place + source["noise_m"] * off),
                *pin.log3(pin.exp3(source["noise_rad"] * turn) @ rotation),
            )
            for (place, rotation), off, turn in zip(
                exact, position, turned, strict=True
            )
        ]
        rows = table[table["target"] == point]
        columns = [
            ("visits", ["pose", "load", "repeat"], visits),
            ("wrenches", [*WRENCH], wrenches),
        ]
        columns += [
            ("joint angles", [f"q{j}" for j in range(1, arm.joints + 1)], of_pose)
        ]
        for words, names, expected in [
            *columns,
            ("measured poses", [*POSITION, "rx", "ry", "rz"], seen),
        ]:
            yield compare(
                f"{words} of {point}",
                "pinocchio, numpy's Philox stream",
                rows[names],
                expected,
                _DIGITS,
            )


def check_split(run: FinishedRun, file: str, campaign: str) -> Iterator[Finding]:
    """Fitted and held-out measurements are those of the campaign's file, each once, and
    share no pose."""
    fitted = run.table(file)
    held_out = run.table(file.replace("training", "held_out"))
    source = f"data/campaigns/{campaign}/measurements.parquet"
    # Of another campaign poses are numbered anew.
    if run.document(f"results/loop/{campaign}/campaign.json").get(
        "held_out"
    ) is None and run.has(source):
        shared = set.intersection(
            *(
                set(zip(frame["session"], frame["pose"], strict=True))
                for frame in (fitted, held_out)
            )
        )
        yield require(
            "no pose is fitted and held out",
            "counting",
            not shared,
            f"{sorted(shared)[:3]}",
            len(fitted),
        )
        original = run.table(source)
        rows = pd.concat([fitted, held_out]).sort_values("row")
        yield compare(
            "every row of the campaign once",
            "counting",
            rows["row"],
            np.arange(1, len(original) + 1),
            0.0,
        )
        yield compare(
            "positions as measured",
            "the campaign's file",
            rows[list(POSITION)],
            original[list(POSITION)],
            0.0,
        )


def check_seals(run: FinishedRun, file: str) -> Iterator[Finding]:
    """Every ground truth of the blind proof is what was sealed, and every sealed one is
    there."""
    there = {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (run.folder / "data/sealed").glob("*/*.json")
    }
    lines = [
        line.partition("  ")
        for line in (run.folder / file).read_text("utf-8").splitlines()
    ]
    off = [name for digest, _, name in lines if there.get(name) != digest]
    yield require(
        "ground truths as they were sealed",
        "the seal",
        not off,
        ", ".join(off[:3]),
        len(lines),
    )


CHECKS = {
    "data/campaigns/{campaign}/measurements.parquet": check_simulated_campaign,
    "results/loop/{campaign}/training.parquet": check_split,
    "reports/blind/manifest.sha256": check_seals,
}
