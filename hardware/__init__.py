"""Everything that is, or stands for, a robot or a phone."""
