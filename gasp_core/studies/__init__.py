"""Many runs of one scene: engines compared, error traded for time."""
