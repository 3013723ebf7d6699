"""The command line, one file a command; `app` finds the command by its name."""
