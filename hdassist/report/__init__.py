"""The answer of a command as it is declared: no form of output is made here."""
