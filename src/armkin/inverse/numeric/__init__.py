"""Newton corrections for any arm and task; linear algebra that outlives one singular member."""
