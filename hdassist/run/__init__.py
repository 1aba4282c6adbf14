"""How work is carried out and kept; nothing here knows what the work is about."""
