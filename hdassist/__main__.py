"""`python -m hdassist`."""

from hdassist.cli.main import main

if __name__ == "__main__":
    main()
