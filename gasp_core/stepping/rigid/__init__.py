"""Rigid bodies for engines that step a grid: six numbers a body, contact with each other, with walls and with nodes."""
