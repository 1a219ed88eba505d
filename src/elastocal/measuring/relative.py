"""Pose of a target against its first pose, as an optical tracker without a base has it.

The frame of the session is then the target at its first pose. It is unknown like that of
any tracker, so nothing but the frame of the campaign distinguishes the two kinds.
"""

from elastocal.measuring.pose import Pose


class Relative(Pose):
    """Pose of a target in the frame that the target had at the first pose."""

    name = "relative"
    meaning = "pose of the target in the frame that it had at the session's first pose"


RELATIVE = Relative()
