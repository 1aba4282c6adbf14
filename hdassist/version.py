"""The version of hdassist."""

__version__ = "1.0.0rc1"
