"""What engines that step may derive from, and what explicit MPM engines share; no engine has to use it."""

STEPPING_VERSION = (1, 0)
"""Major, minor, of this base and its extension points; a number of its own, since an engine can meet the contract
without it. A minor step adds what need not be overridden."""
