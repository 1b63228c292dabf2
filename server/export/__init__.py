"""Recordings in the formats of others: one file each, from one decoded record."""
