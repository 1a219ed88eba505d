"""Mechanics of a serial robot: the chain, its kinematics and elastostatics, elastic
links, and the sites where an effect can act.

Equations 1 to 10 of the study, for arrays with any leading axes.
"""
