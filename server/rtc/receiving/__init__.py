"""From RTP packets to frames with their times, sans-I/O."""
