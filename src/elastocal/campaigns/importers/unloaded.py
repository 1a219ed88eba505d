"""What all public campaigns have in common: a tracker's measurements of an unloaded flange, in a frame that nobody knows."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any

# What such data can be fitted with at all before any physics is looked for.
_DECLARED = ("joint_offset", "link_geometry")


def unloaded_document(
    name: str,
    robot: str,
    measured: str,
    targets: Iterable[str],
    holdout: Mapping[str, Any] | None = None,
    noise: Mapping[str, float] | None = None,
    point: str = "6DoF",
) -> dict[str, Any]:
    """Contents of ``campaign.yaml``: targets on the flange whose offsets nobody knows.

    `measured`: one of "position", "pose". `point`: measuring point of the chain to which the targets belong: its last.
    """
    document = {
        "campaign": name,
        "robot": robot,
        "measured": measured,
        "frame": "tracker",
        "targets": {target: {"point": point, "offset_m": "unknown"} for target in targets},
        "compliance": "nominal",
        "declared": list(_DECLARED),
    }
    return document | ({"noise": dict(noise)} if noise else {}) | ({"holdout": dict(holdout)} if holdout else {})
