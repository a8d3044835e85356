"""A plugin that prints and then tries to end the program while it is imported."""

import sys

print("this must not get into the JSON")
sys.exit(0)
