"""The screen that shows a robot of light."""
