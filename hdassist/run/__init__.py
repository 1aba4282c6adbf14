"""How work of any kind is carried out and kept."""
