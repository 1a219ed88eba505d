"""What proves the tool: no user needs it but for `elastocal demo`, whose robot is one
of `plant`.

Rooms, from the ground up; they import what they like of `elastocal`, but for `plant`,
which takes its errors alone:

    plant                                 a physical robot with hidden defects
    blind, league                         the blind proof and the closed loop on that robot; methods on public data
    audit                                 samples of every file worked out again by other libraries
    figures, report                       what people see of these
"""
