"""The link of RPIt's socket block: thrusts out, body sensors in, over one struct each way."""
