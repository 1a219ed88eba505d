"""Where to measure: the configurations and loads that determine the parameters of a
robot best, among those that arm, cell and tracker allow."""
