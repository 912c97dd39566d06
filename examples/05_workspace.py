"""The workspace: how far the tool reaches, and how much room that is."""

import armkin

found = armkin.workspace(armkin.load("three_dof"), 20_000)  # so many random postures within the limits
print("reach", [round(r, 1) for r in found.reach], "mm")  # least and greatest distance from the base
assert found.extent is not None  # every arm that moves in space or in a plane has a volume or an area
print(f"volume {found.extent.value / 1e9:.4f} m3, {found.extent.method.split(',')[0]}")
