"""MLS-MPM in plain NumPy: the engine other engines are measured against, and the one to copy when writing your own."""
