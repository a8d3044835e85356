"""pytest plugin: `--gasp-engine NAME`."""
