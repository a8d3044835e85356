"""Engines that are opened: in this process, or in a worker of their own."""
