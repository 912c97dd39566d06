"""Klipper: an arm's steppers as `manual_stepper` sections, moved together through the API server's socket."""
