"""What an engine is to GASP: the contract, the registry that finds engines, and the check of scene against engine."""
