"""Arms: joints that a twist of their tip moves, before a simulated arm or a real one."""
