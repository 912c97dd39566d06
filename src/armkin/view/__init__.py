"""What an arm looks like: lines and points from its axes."""
