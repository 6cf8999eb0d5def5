"""What the commands do, from beginning to end."""
