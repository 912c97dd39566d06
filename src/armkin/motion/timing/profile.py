"""Time laws of one parameter from rest to rest: speed up, cruise, slow down.

A profile is a list of phases of constant jerk, each with position, speed and acceleration at its start, and can be
evaluated exactly at any time.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from armkin.formula.arrays import Array


@dataclass(frozen=True)
class Profile:
    """Position over time in phases of constant jerk; lengths in whatever unit the parameter has."""

    times: Array  # (k + 1,) [s] where the phases begin, and the end
    states: Array  # (k, 3) position, speed, acceleration at the start of every phase
    jerk: Array  # (k,)
    length: float  # position at the end
    accel: float  # greatest acceleration that is reached

    @property
    def duration(self) -> float:
        """Seconds from rest to rest."""
        return float(self.times[-1])

    @property
    def is_trapezoid(self) -> bool:
        """Whether the profile has three phases of constant acceleration."""
        return len(self.jerk) == 3 and not self.jerk.any()

    @property
    def peak(self) -> float:
        """Greatest speed that is reached."""
        return float(self.states[:, 1].max(initial=0.0))

    def evaluate(self, t: ArrayLike, derivative: int = 0) -> Array:
        """Position (derivative 0), speed (1), acceleration (2) or jerk (3) at times t: (...,) -> (...,)."""
        times = np.clip(np.asarray(t, dtype=float), 0.0, self.duration)
        if not len(self.jerk):
            return np.zeros_like(times)
        phase = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.jerk) - 1)
        (x, v, a), j, h = self.states[phase].T, self.jerk[phase], times - self.times[phase]
        if derivative == 0:
            return np.asarray(np.minimum(x + h * (v + h * (a / 2 + h * j / 6)), self.length)).T
        return np.asarray((v + h * (a + h * j / 2), a + h * j, j)[derivative - 1]).T


def trapezoid(length: float, speed: float, accel: float) -> Profile:
    """The fastest profile over `length` from rest to rest with bounded speed and acceleration.

    >>> round(trapezoid(85, 60, 120).duration, 6), trapezoid(85, 60, 120).peak
    (1.916667, 60.0)
    >>> trapezoid(30, 60, 120).duration
    1.0
    """
    if length <= 0:
        return rest_profile(0.0)
    peak = min(speed, math.sqrt(accel * length))
    ramp = peak / accel
    ramp_length = peak * ramp / 2
    cruise = max(length - 2 * ramp_length, 0.0) / peak
    times = np.array([0.0, ramp, ramp + cruise, 2 * ramp + cruise])
    states = np.array([[0.0, 0.0, accel], [ramp_length, peak, 0.0], [length - ramp_length, peak, -accel]])
    return Profile(times, states, np.zeros(3), length, accel)


def seven_phases(length: float, speed: float, accel: float, jerk: float) -> Profile:
    """The fastest profile over `length` from rest to rest with bounded speed, acceleration and jerk.

    The closed form of seven phases (Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and
    Robots, 2008, section 3.4), in which phases that are not needed have length 0.

    >>> round(seven_phases(1.0, 1.0, 1.0, 1.0).duration, 6), round(seven_phases(10.0, 1.0, 2.0, 8.0).duration, 6)
    (3.174802, 10.75)
    """
    if length <= 0:
        return rest_profile(0.0)
    jerk_time = min(accel / jerk, math.sqrt(speed / jerk))  # time in which the acceleration changes
    rise = jerk_time + speed / (jerk_time * jerk)  # whole time of speeding up
    cruise = length / speed - rise
    if cruise < 0:
        cruise = 0.0
        jerk_time = accel / jerk
        if length >= 2 * accel * jerk_time**2:
            rise = jerk_time / 2 + math.sqrt(jerk_time**2 / 4 + length / accel)
        else:
            jerk_time = (length / (2 * jerk)) ** (1 / 3)
            rise = 2 * jerk_time
    spans = np.array([jerk_time, rise - 2 * jerk_time, jerk_time, cruise, jerk_time, rise - 2 * jerk_time, jerk_time])
    signs = np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0]) * jerk
    spans = np.maximum(spans, 0.0)
    state, states = np.zeros(3), []
    for h, j in zip(spans, signs, strict=True):
        states.append(state)
        x, v, a = state
        state = np.array([x + h * (v + h * (a / 2 + h * j / 6)), v + h * (a + h * j / 2), a + h * j])
    times = np.concatenate([[0.0], np.cumsum(spans)])
    return Profile(times, np.array(states), signs, length, jerk * jerk_time)


def rest_profile(seconds: float) -> Profile:
    """A profile that stays where it is for so many seconds."""
    return Profile(np.array([0.0, seconds]), np.zeros((1, 3)), np.zeros(1), 0.0, 0.0)
