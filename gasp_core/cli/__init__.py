"""The command ``gasp``. Each subcommand is a module of its own, imported when it is run."""
