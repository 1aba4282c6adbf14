"""`python -m hdassist`, and where the hdassist command begins: before anything else is imported stops end it."""

from hdassist.run.stops import end_at_stops

end_at_stops()


def main() -> None:
    """Run the command line and leave with its exit code."""
    from hdassist.cli import run_command_line

    run_command_line()


if __name__ == "__main__":
    main()
