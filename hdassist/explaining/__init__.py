"""What words, symbols, fields, checks and errors mean."""
