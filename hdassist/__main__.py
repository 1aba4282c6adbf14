"""`python -m hdassist`, and where the hdassist command begins: before anything else is imported stops end it."""

import sys

from hdassist.run.stops import end_at_stops

end_at_stops()


def main() -> None:
    """Run the command line and leave with its exit code."""
    from hdassist.cli import LoadedWhenUsed, run_command_line

    sys.meta_path.insert(0, LoadedWhenUsed())
    run_command_line()


if __name__ == "__main__":
    main()
