"""A board inside the process that speaks the firmware's bytes, in simulated time."""
