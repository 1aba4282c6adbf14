"""The version of hdassist."""

__version__ = "0.1.0"
