"""`python -m hdassist`, and where the hdassist command begins.

Before anything else is imported an interrupt is made to end the process at once, as it does any other program: an
import that is broken off would print a traceback.
"""

import signal

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def main() -> None:
    """Run the command line and leave with its exit code."""
    from hdassist.cli.main import main as run

    if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


if __name__ == "__main__":
    main()
