"""Postures with joint 5 straight whose end effector is turned by right angles alone: its rotation shows no rounding."""

from __future__ import annotations

POSTURES = {  # [deg]
    "thor": [[90, -75, -15, 150, 0, -60], [90, -30, 30, -60, 0, -120], [-150, 60, -60, -165, 0, -135]],
    "puma560": [[90, -75, 75, 60, 0, 30], [0, -40, -50, -45, 0, 135], [-90, 15, -105, 75, 0, 15]],
    "ur5e": [[0, -75, 30, 45, 0, 90], [90, -105, 75, 120, 0, -90], [-90, -60, -45, 15, 0, 180]],
}
