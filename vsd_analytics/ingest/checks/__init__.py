"""What looks wrong about a source, before any of it is stored."""
