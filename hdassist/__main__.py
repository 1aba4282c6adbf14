"""Entry point of `python -m hdassist` and of the hdassist command; installs the stop signals before further imports."""

from hdassist.run.stops import end_at_stops

end_at_stops()


def main() -> None:
    """Run the command line and exit with its exit code."""
    from hdassist.interface.cli import run_command_line

    run_command_line()


if __name__ == "__main__":
    main()
