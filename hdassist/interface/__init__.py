"""The interface: command line, commands, pages, terminal and explorer."""
