"""Figures of study, loop and blind proof: tables in, PDF out.

Imports tables' contents and names from `study`, `diagnosis` and `blind`; computes nothing.
"""
