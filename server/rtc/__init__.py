"""The fast path: pictures and motion by WebRTC. Nothing else imports aiortc."""
