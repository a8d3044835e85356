"""What explicit MPM engines share that needs no backend."""
