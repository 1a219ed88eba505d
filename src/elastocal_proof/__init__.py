"""What proves the tool: no user needs it but for the demonstration, and the tool imports it nowhere else."""
