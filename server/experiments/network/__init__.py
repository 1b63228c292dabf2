"""`lightleash experiments network`: WebRTC and websockets over bad lines."""
