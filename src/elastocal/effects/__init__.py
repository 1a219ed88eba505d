"""The catalogue of physical effects that a calibrated model may lack, one module for each.

A module with a NAME is an effect: see `protocol`; the others are what effects share. Imports `mechanics` alone.
"""
