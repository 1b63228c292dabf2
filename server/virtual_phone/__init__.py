"""What leads without a phone: scripts, clients, the command."""
