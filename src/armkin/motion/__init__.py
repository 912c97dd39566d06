"""Waypoints -> trajectory."""
