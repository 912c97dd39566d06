"""Bus servos: Feetech STS3215 and its kin."""
