"""Figures of study and loop: tables in, PDF out.

Imports tables' contents and names from `study` and `diagnosis`; computes nothing.
"""
