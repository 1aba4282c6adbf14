"""The command line: one file a command, thin; heavy imports wait until a command runs."""
