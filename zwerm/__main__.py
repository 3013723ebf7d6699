"""`zwerm` and `python -m zwerm`. Says before anything is loaded what Ctrl-C means: loading takes a while, too."""

import sys


def main() -> None:
    """Load the command line and run it."""
    try:
        from zwerm.cli.app import main as command_line

        command_line()
    except KeyboardInterrupt:
        sys.stderr.write("zwerm: interrupted\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
