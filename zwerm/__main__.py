"""`zwerm` and `python -m zwerm`. It defines the effect of Ctrl-C before it loads anything, because loading takes
time."""

import sys


def main() -> None:
    """Load the command line and run it."""
    try:
        from zwerm.cli.app import main as command_line

        command_line()
    except (KeyboardInterrupt, RuntimeError) as error:
        # Python 3.11 makes a RuntimeError of an interrupt in the middle of a class statement.
        if not any(isinstance(each, KeyboardInterrupt) for each in (error, error.__cause__)):
            raise
        sys.stderr.write("zwerm: interrupted\n")
        sys.exit(130)
    finally:
        # Python ends itself by SIGINT, with another exit status, if an interrupt came while it executed a text, as libraries
        # do to make classes, although it was handled. The next text that it executes undoes that.
        exec("")
        _ignore_signals()


def _ignore_signals() -> None:
    """Let no signal change the exit status any more: the command is over, and Python may take a while to end."""
    import signal  # no command needs it earlier

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


if __name__ == "__main__":
    main()
