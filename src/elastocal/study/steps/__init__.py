"""The steps of the study: each turns the tables of the step before into its own, block of data sets by block.

A module here knows the columns of tables and calls the science; it knows neither files nor the order of the steps.
"""
