"""What a target prescribes, and which task fits an arm."""
