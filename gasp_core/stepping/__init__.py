"""What engines that step may derive from, and what explicit MPM engines share; no engine has to use it."""
