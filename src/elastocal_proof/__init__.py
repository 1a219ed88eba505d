"""Proofs that the tool works; users need none of them except `elastocal demo`, whose
robot is one of `plant`.

Packages from the lowest layer upwards. They import any part of `elastocal`, except
`plant`, which takes only its errors:

    plant            simulated physical robots with hidden defects
    blind, league    blind benchmark and closed loop on these robots; methods on public data
    audit            samples of every file, computed again by other libraries
    figures, report  figures and pages for readers
"""
