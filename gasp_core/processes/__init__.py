"""Processes that are started and watched: what they use, how they and theirs are ended, and what is said of one then.

Whoever starts a process has it lead a group, with `start_new_session`, and holds its stdin open. The process has a
guard, which ends the group once nobody does, however that came; see `guard`.
"""
