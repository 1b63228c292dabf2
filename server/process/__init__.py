"""What `lightleash serve` starts: the launcher and the server process."""
