"""Meanings of words, symbols, fields, checks and errors."""
