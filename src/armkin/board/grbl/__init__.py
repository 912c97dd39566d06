"""GRBL 1.1, grblHAL, FluidNC: up to six stepper axes, degrees as millimetres."""
