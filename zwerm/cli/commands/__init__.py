"""The built-in commands, one file each. Each module imports other rooms only inside its function."""
