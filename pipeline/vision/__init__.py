"""Picture after picture → named LEDs and a judged pose: what a live phone and a folder share."""
