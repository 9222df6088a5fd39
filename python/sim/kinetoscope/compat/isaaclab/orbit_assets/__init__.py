"""Ready configurations of robots."""
