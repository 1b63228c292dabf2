"""Spots → which LED each one is, and the pose that fits: from nothing. Sec. III-C."""
