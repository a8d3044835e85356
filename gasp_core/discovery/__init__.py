"""What is installed: hooks, plugins, the registry of what they offer, and the state of each."""
