"""Kinds of measurement: how a row of a campaign depends on the pose of its target. Each
module of this package except `protocol`, `catalogue` and `features` is one kind."""
