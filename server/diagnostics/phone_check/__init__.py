"""What a phone shows of itself, what that means and what to change: of a recording, or live."""
