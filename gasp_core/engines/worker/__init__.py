"""Engines in a process of their own, which may be of another environment and may die without taking anybody along."""
