"""The workspace: how far the tool reaches, and how much room that is."""

import armkin

found = armkin.workspace(armkin.load("three_dof"), 20_000)
print("reach", [round(r, 1) for r in found.reach], "mm")
assert found.extent is not None
print(f"volume {found.extent.value / 1e9:.4f} m3, {found.extent.method.split(',')[0]}")
