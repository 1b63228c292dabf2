"""`lightleash tune`: gains for a measured latency, under stated margins."""
