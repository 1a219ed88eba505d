"""Mechanics of a serial robot: the chain, its kinematics and elastostatics, elastic
links, where an effect can act.

Equations 1 to 10 of the study, over any leading axes. Imports `elastocal.errors` alone.
"""
