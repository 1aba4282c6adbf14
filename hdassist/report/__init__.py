"""Answers as tables, plots, JSON and CSV."""
